"""Files of an S3-like store and of a web server, read where they are wanted; both servers are on this machine."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pyarrow.dataset as ds
import pytest
from pyarrow import fs

from benchmarks.fleet import FLEET_FILE, write_fleet
from pneucli.config import load_fleet
from pneucli.errors import InputError
from pneucli.fleet import run as stage
from pneucli.io.remote_files import content_stamp, fetch, is_remote, store_error
from pneucli.io.result_store import mirror_folder, store_at

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
    assert "secret" not in str(store_error("s3://user:secret@b/x.csv", OSError("no")))


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
