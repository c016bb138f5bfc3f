"""The fixtures are what fixtures/make.py writes, and the virtual rig still gives them."""

import hashlib
import importlib.util
import json
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1] / "fixtures"
HASHES = json.loads((HERE / "hashes.json").read_text())


@pytest.fixture(scope="module")
def make():
    spec = importlib.util.spec_from_file_location("fixtures_make", HERE / "make.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules["fixtures_make"] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules["fixtures_make"]


@pytest.mark.parametrize("name", HASHES)
def test_a_fixture_is_the_one_that_was_made(name):
    assert hashlib.sha256((HERE / name).read_bytes()).hexdigest() == HASHES[name]


def test_every_recording_is_hashed(make):
    folders = [HERE / fixture.laboratory.name for fixture in make.fixtures()]
    assert {p.relative_to(HERE).as_posix() for folder in folders for p in folder.iterdir()} < set(HASHES)


def test_the_rig_still_gives_a_fixture_bit_for_bit(make, tmp_path):
    fixture = make.friction("friction_null_coulomb", {}, (), 3)
    fixture.write(tmp_path)
    for path in (tmp_path / "friction_null_coulomb").glob("*.csv"):
        assert hashlib.sha256(path.read_bytes()).hexdigest() == HASHES[f"friction_null_coulomb/{path.name}"]


def test_the_truth_is_that_of_the_rigs(make):
    truths = json.loads((HERE / "truth.json").read_text())
    assert truths == {f.laboratory.name: make.truth(f) for f in make.fixtures()}


def test_all_fixtures_together_are_small():
    files = [path for path in HERE.rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    assert sum(path.stat().st_size for path in files) < 6e6
