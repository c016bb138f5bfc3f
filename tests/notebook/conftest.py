"""Two small runs: a valve test, and a cylinder without effects, both of the virtual rig."""

from pathlib import Path

import pytest

import pneucli

FIXTURES = Path(__file__).parents[2] / "fixtures"


@pytest.fixture(scope="session")
def valve(tmp_path_factory: pytest.TempPathFactory) -> pneucli.Run:
    """The run of a valve test, brought up to date by what is asked of it."""
    return pneucli.open(FIXTURES / "valve_null" / "pipeline.toml", tmp_path_factory.mktemp("valve"), quiet=True)


@pytest.fixture(scope="session")
def axis(tmp_path_factory: pytest.TempPathFactory) -> pneucli.Run:
    """The run of a cylinder that slides and sticks."""
    file = FIXTURES / "friction_null_coulomb" / "pipeline.toml"
    return pneucli.open(file, tmp_path_factory.mktemp("axis"), quiet=True)
