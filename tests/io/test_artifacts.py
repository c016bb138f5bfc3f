"""Artifacts: what was written is read back, with units, and a file is whole or not there."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from pneucli.errors import InputError
from pneucli.io.artifacts import Provenance, atomic_path, read_metadata, read_table, write_table

MADE = Provenance({"raw.csv": "ab12"}, {"horizon": 0.5})


def test_a_table_comes_back_with_units_and_provenance(tmp_path: Path) -> None:
    columns = {"recording": ["a", "b"], "p1": np.array([1.5, np.nan]), "count": [1, 2], "ok": [True, False]}
    write_table(tmp_path / "t.parquet", columns, units={"count": "1"}, schema="pneucli/test/1", provenance=MADE)
    table = read_table(tmp_path / "t.parquet")
    assert table["recording"] == ["a", "b"]
    np.testing.assert_array_equal(table["p1"], [1.5, np.nan])
    np.testing.assert_array_equal(table["count"], [1, 2])
    about = read_metadata(tmp_path / "t.parquet")
    assert about["schema"] == "pneucli/test/1"
    assert about["inputs"] == MADE.inputs
    assert about["parameters"] == MADE.parameters
    assert about["units"] == {"recording": "", "p1": "Pa", "count": "1", "ok": ""}
    assert pq.read_schema(tmp_path / "t.parquet").field("p1").metadata == {b"unit": b"Pa"}


def test_a_number_without_unit_is_a_fault_of_the_program(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="gain has no unit"):
        write_table(tmp_path / "t.parquet", {"gain": [1.0]}, schema="pneucli/test/1", provenance=MADE)
    assert list(tmp_path.iterdir()) == []


def test_what_fails_half_way_leaves_the_old_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    with pytest.raises(OSError, match="disk full"):
        _write_half(tmp_path / "a")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a", "old")]


def _write_half(path: Path) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text("half")
        raise OSError("disk full")


def test_a_damaged_or_missing_artifact_says_so(tmp_path: Path) -> None:
    (tmp_path / "t.parquet").write_text("nothing")
    with pytest.raises(InputError, match="not a Parquet file"):
        read_table(tmp_path / "t.parquet")
    with pytest.raises(InputError, match="no such artifact"):
        read_table(tmp_path / "u.parquet")
