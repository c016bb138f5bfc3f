"""The table of a fleet and the pipeline of each row: keys, paths, and rows that are wrong by themselves."""

from __future__ import annotations

import tomllib
from datetime import date, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pneucli.config import keys_at
from pneucli.errors import InputError
from pneucli.fleet.row_files import FleetRow, folder_name, raw_file_names, read_rows, require_columns, row_pipeline

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
