"""The table of a fleet and the pipeline of each row: keys, paths, and rows that are wrong by themselves."""

import http.server
import threading
import tomllib
from collections.abc import Iterator
from datetime import date, datetime
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest
from pyarrow import fs

from benchmarks.fleet import FLEET_FILE, write_fleet
from pneucli.config import keys_at, load_fleet
from pneucli.errors import InputError
from pneucli.fleet import run as stage
from pneucli.fleet.row_files import FleetRow, folder_name, raw_file_names, read_rows, require_columns, row_pipeline
from pneucli.io.result_store import (
    content_stamp,
    fetch,
    is_remote,
    mirror_folder,
    store_at,
    store_errors_as_input_errors,
)

TEMPLATE = """\
# the test bench
[pipeline]
name = "template"

[rig.cylinder]
moving_mass = "2 kg"

[[recordings]]
name = "stairs"
file = "raw/stairs.csv"
experiment = "valve"
use = "train"
"""


def table(folder: Path, text: str) -> Path:
    path = folder / "rigs.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_cells_are_numbers_where_they_look_so_and_files_stay_texts(tmp_path: Path) -> None:
    path = table(tmp_path, "rig;date;compare.horizon;recordings.stairs.file;rig.gas\nA 1;2026-01-31;0.2;7;\n")
    (row,) = read_rows(path)
    assert (row.rig, row.date, row.line) == ("A 1", "2026-01-31", 2)
    assert row.values == {"compare.horizon": 0.2, "recordings.stairs.file": "7"}


def test_a_parquet_table_has_the_same_rows(tmp_path: Path) -> None:
    path = tmp_path / "rigs.parquet"
    columns = {"rig": ["a", "b"], "date": [date(2026, 1, 2), date(2026, 1, 3)], "compare.horizon": [0.2, None]}
    pq.write_table(pa.table(columns), path)
    assert [(r.rig, r.date, r.values) for r in read_rows(path)] == [
        ("a", "2026-01-02", {"compare.horizon": 0.2}),
        ("b", "2026-01-03", {}),
    ]
    pq.write_table(pa.table({"rig": ["a"], "date": [datetime(2026, 1, 2, 5)]}), path)
    assert read_rows(path)[0].date == "2026-01-02T05:00:00"


@pytest.mark.parametrize(
    ("cells", "says"),
    [
        ("a,yesterday", "no date"),
        (",2026-01-01", "name of a rig"),
        ("ok,2026-01-01\nok,2026-01-01", "already in line 2"),
    ],
)
def test_a_faulty_row_has_a_fault_and_the_others_none(tmp_path: Path, cells: str, says: str) -> None:
    rows = read_rows(table(tmp_path, f"rig,date\n{cells}\nlast,2026-01-01\n"))
    assert says in rows[-2].fault
    assert rows[-1].fault == ""
    assert len({row.key for row in rows}) == len(rows)


@pytest.mark.parametrize(
    ("text", "says"),
    [("rig,when\na,b\n", "no column date"), ("rig,date,x,x\n", "two columns"), ("rig,date\na\n", "line 2: 1 cells")],
)
def test_an_unreadable_table_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_rows(table(tmp_path, text))


@pytest.mark.parametrize(
    ("column", "says"),
    [("rig.cylinder.moving_mas", "moving_mass"), ("recordings.stars.file", "stairs"), ("rigg.gas", "rig")],
)
def test_an_unknown_column_is_refused_with_the_closest_key(column: str, says: str) -> None:
    with pytest.raises(InputError, match=f'did you mean "{says}"'):
        require_columns(tomllib.loads(TEMPLATE), [column], keys_at, "rigs.csv")
    require_columns(tomllib.loads(TEMPLATE), ["recordings.stairs.from", "rig.vessel.volume"], keys_at, "rigs.csv")


def test_a_row_becomes_the_template_with_its_values_and_absolute_paths(tmp_path: Path) -> None:
    values = {"rig.cylinder.moving_mass": "3 kg", "rig.vessel.volume": "1 l", "recordings.stairs.use": "test"}
    text = row_pipeline(TEMPLATE, FleetRow(2, "a/1", "2026-01-01", values), (tmp_path / "t", tmp_path))
    document = tomllib.loads(text)
    assert document["rig"] == {"cylinder": {"moving_mass": "3 kg"}, "vessel": {"volume": "1 l"}}
    assert document["pipeline"]["name"] == "a_1"
    assert document["recordings"][0]["use"] == "test"
    assert raw_file_names(document) == [str(tmp_path / "t" / "raw" / "stairs.csv")]
    assert "# the test bench" in text
    for file, found in [("d/x.csv", str(tmp_path / "d" / "x.csv")), ("s3://b/x.csv", "s3://b/x.csv")]:
        row = FleetRow(2, "a", "2026-01-01", {"recordings.stairs.file": file})
        assert raw_file_names(tomllib.loads(row_pipeline(TEMPLATE, row, (tmp_path / "t", tmp_path)))) == [found]


def test_names_of_folders_do_not_leave_the_folder_and_stay_apart() -> None:
    assert "/" not in folder_name("../x")
    assert len({folder_name(name) for name in ("a/b", "a%2Fb", "a_b")}) == 3


# --- files of an S3-like store and of a web server, read where they are wanted; both servers are on this machine


CONTENT = b"t,p\n0,1\n" * 1000


@pytest.fixture(scope="module")
def store() -> Iterator[str]:
    """An S3-like store with one file in it; yields its URL without the file's name, and the endpoint as its query."""
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    query = f"endpoint_override={host}:{port}&scheme=http&region=us-east-1&allow_bucket_creation=true"
    system, _ = fs.FileSystem.from_uri(f"s3://rigs?{query}")
    system.create_dir("rigs")
    with system.open_output_stream("rigs/a b.csv") as file:
        file.write(CONTENT)
    yield f"s3://rigs/{{}}?{query}"
    server.stop()


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A web server with one file."""
    pytest.importorskip("aiohttp")
    folder = tmp_path_factory.mktemp("web")
    (folder / "a.csv").write_bytes(CONTENT)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/{{}}"
        server.shutdown()


def test_a_url_is_not_a_path() -> None:
    assert is_remote("s3://b/x.csv")
    assert is_remote("https://host/x.csv")
    assert not is_remote("raw/x.csv")
    assert not is_remote("C:\\raw\\x.csv")


@pytest.mark.parametrize(("where", "name"), [("store", "a b.csv"), ("web", "a.csv")])
def test_a_remote_file_is_fetched_unchanged_and_recognised(
    where: str, name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    url = request.getfixturevalue(where).format(name.replace(" ", "%20"))
    path = fetch(url, tmp_path)
    assert (path.suffix, path.read_bytes()) == (".csv", CONTENT)
    assert content_stamp(url) == content_stamp(url)
    assert str(len(CONTENT)) in content_stamp(url)


@pytest.mark.parametrize("where", ["store", "web"])
def test_a_missing_remote_file_is_an_input_error(where: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    url = request.getfixturevalue(where).format("none.csv")
    for ask in (content_stamp, partial(fetch, folder=tmp_path)):
        with pytest.raises(InputError, match=r"none\.csv.*cannot be read"):
            ask(url)


def test_an_error_hides_passwords() -> None:
    with pytest.raises(InputError) as told, store_errors_as_input_errors("s3://user:secret@b/x.csv"):
        raise OSError("no")
    assert "secret" not in str(told.value)


def test_a_remote_folder_behaves_like_a_local_one(store: str, tmp_path: Path) -> None:
    """What is written is read, listed, fetched, and gone when it is removed; what is not there is None."""
    raw = tmp_path / "raw"
    raw.write_bytes(CONTENT)
    for place in (store_at(store.format("out")), store_at(str(tmp_path / "out"))):
        place.write("rows/a/row.json", "{}")
        place.copy_file("rows/a/reference/model", raw)
        assert place.read_all(["rows/a/row.json", "rows/b/row.json"]) == {
            "rows/a/row.json": b"{}",
            "rows/b/row.json": None,
        }
        assert place.names("rows") == {"rows/a/row.json", "rows/a/reference/model"}
        assert (place.local_copy("rows/a/reference", tmp_path / "here") / "model").read_bytes() == CONTENT
        place.remove("rows/a/row.json")
        assert place.names("rows") == {"rows/a/reference/model"}


def test_a_store_mirrors_a_folder_and_keeps_foreign_files(store: str, tmp_path: Path) -> None:
    place = store_at(store.format("mirrored"))
    for name in ("results/date=1/part-0.parquet", "results/date=1/notes.txt", "rows/a/row.json"):
        place.write(name, "old")
    (tmp_path / "results" / "date=2").mkdir(parents=True)
    (tmp_path / "results" / "date=2" / "part-0.parquet").write_text("new")
    mirror_folder(tmp_path, place, {"results": "part-0.parquet"})
    assert place.names("") == {"results/date=2/part-0.parquet", "results/date=1/notes.txt", "rows/a/row.json"}


def test_a_remote_store_gets_the_same_files_and_resumes(store: str, tmp_path: Path) -> None:
    write_fleet(tmp_path, rigs=1, dates=2, changed=1.0, seed=4)
    with (tmp_path / FLEET_FILE).open("a", encoding="utf-8") as file:
        file.write('reports = "none"\n')
    config, url = load_fleet(tmp_path / FLEET_FILE), store.format("plant")
    here, there, again = (stage.run(config, where) for where in (tmp_path / "out", url, url))
    different = {"seconds", "out", "done", "unchanged"}
    assert {k: v for k, v in here.items() if k not in different} == {
        k: v for k, v in there.items() if k not in different
    }
    assert (there["done"], again["done"]) == (2, 0)
    assert "endpoint" not in there["out"]
    names = {p.relative_to(tmp_path / "out").as_posix() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    assert store_at(url).names("") == names - {".lock"}
    system, path = fs.FileSystem.from_uri(url)
    read = ds.dataset(f"{path}/changes", filesystem=system, partitioning="hive").to_table().to_pylist()
    assert [one["rig"] for one in read] == [one["rig"] for one in here["changes"]] != []


def test_a_store_that_refuses_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="s3://rigs/x"):
        store_at("s3://rigs/x?endpoint_override=127.0.0.1:1&scheme=http&region=us-east-1").read("a")
