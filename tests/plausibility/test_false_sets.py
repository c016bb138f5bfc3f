"""False data sets are found out, and good ones are left alone."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest
from tests.plausibility.false_sets import BASES, SETS, Rig, looked_at

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("PNEUCLI_DATA", ROOT.parent / "shared" / "real"))
CASES = Path(os.environ.get("PNEUCLI_CASES", ROOT.parent / "shared" / "cases"))
REAL = sorted(path for path in (ROOT / "pipelines").glob("*.toml") if "PNEUCLI_DATA" in path.read_text())

needs_real = pytest.mark.skipif(not DATA.is_dir(), reason="the real recordings are not here (PNEUCLI_DATA)")
needs_cases = pytest.mark.skipif(not CASES.is_dir(), reason="the cases are not here (PNEUCLI_CASES)")


@pytest.mark.parametrize("name", SETS)
def test_a_false_data_set_is_found_out(name: str, tmp_path: Path) -> None:
    found = looked_at(SETS[name].make(noise=True), tmp_path)["plausibility"]
    assert {(one["check"], one["signal"]) for one in found} & SETS[name].expected, found
    assert all(one["found"] and one["mend"] and one["recording"] for one in found)


@pytest.mark.parametrize("base", BASES)
def test_a_good_data_set_is_left_alone(base: str, tmp_path: Path) -> None:
    assert looked_at(Rig.of(base, noise=True), tmp_path)["plausibility"] == []


def plausibility(path: Path, out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = ingest.run(Context(path, load(path), out / "ingest", out))["plausibility"]
    return found


@pytest.mark.parametrize("path", sorted((ROOT / "fixtures").glob("*/pipeline.toml")), ids=lambda path: path.parent.name)
def test_nothing_is_found_in_the_fixtures(path: Path, tmp_path: Path) -> None:
    assert plausibility(path, tmp_path) == []


@needs_real
@pytest.mark.real
@pytest.mark.parametrize("path", REAL, ids=lambda path: path.stem)
def test_nothing_is_found_in_real_recordings(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PNEUCLI_DATA", str(DATA))
    assert plausibility(path, tmp_path) == []


@needs_cases
@pytest.mark.real
@pytest.mark.parametrize("path", sorted(CASES.glob("*/pipeline.toml")), ids=lambda path: path.parent.name)
def test_nothing_is_found_in_the_cases(path: Path, tmp_path: Path) -> None:
    assert plausibility(path, tmp_path) == []
