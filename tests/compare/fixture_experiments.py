"""Fixtures of the virtual rig with the parameters that made them."""

import json
from pathlib import Path

import pytest

from pneucli.config import load
from pneucli.io.recordings import load_recordings
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import Context
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages import ingest

FIXTURES = Path(__file__).parents[2] / "fixtures"
FixtureExperiments = tuple[Model, list[Experiment]]


def load_fixture(name: str, factory: pytest.TempPathFactory) -> FixtureExperiments:
    """Return the true model of a fixture and its recordings, with the pipeline's horizon."""
    path, out = FIXTURES / name / "pipeline.toml", factory.mktemp(name)
    config = load(path)
    ingest.run(Context(path, config, out, out.parent))
    rig = config.to_rig()
    experiments = [prepare(r, rig, config.compare.horizon, config.compare.low_pass) for r in load_recordings(out)]
    truth = json.loads((FIXTURES / "truth.json").read_text())[name]
    return Model(rig, *_effects(truth), _valve(truth["parameters"])), experiments


def _effects(truth: dict) -> tuple:
    given = truth["parameters"]
    values = {"friction.coulomb": given["coulomb"], "friction.viscous": given["viscous"]}
    if truth["vessel_volume"]:
        values["rig.vessel_volume"] = truth["vessel_volume"]
    if "stribeck" in truth["effects"]:
        values |= {"stribeck.static": given["static"], "stribeck.velocity": given["stribeck_velocity"]}
    return tuple(catalogue()[name] for name in truth["effects"]), values


def _valve(given: dict[str, float]) -> ValveArea:
    """A power law beyond the overlap, which two knots a side hold exactly."""
    overlap, exponent = given["overlap"], given["exponent"]
    knots = (overlap + 1.0, 10.0)
    areas = [given["effective_area"] * ((u - overlap) / (10 - overlap)) ** exponent for u in knots]
    commands = (-knots[1], -knots[0], *knots)
    return ValveArea(commands, (areas[1], areas[0], *areas), overlap, overlap)
