"""With the true parameters, recordings of a rig without hidden effects deviate from the model by noise only.

The recordings are the fixtures, made by the exam's rig with a code and integrator of its own; the truth is what was
set there. A correct model of noise and restarts gives ratios of about 1. Pressures do so one by one. Motion under dry
friction does so on the whole only: whether noise lets a break-away come a sample before or after decides most of a
channel's error, a recording has few of them, and six draws see few; so channels of motion are judged together.
"""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pneucli.compare import ChannelResult, compare
from pneucli.compare.expected_error import expected_rms
from pneucli.config import load
from pneucli.io.recordings import load_recordings
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import Context
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages import ingest

FIXTURES = Path(__file__).parents[2] / "fixtures"
TRUTH = json.loads((FIXTURES / "truth.json").read_text())
# of the demo only the axis: what else it has, the others show
RECORDINGS = {"valve_null": "", "friction_null_coulomb": "", "friction_null_stribeck": "", "demo": "axis"}
PRESSURES = ("p1", "p2")
DRAWS = 30  # draws of noise: a break-away that falls otherwise is in one of ten


def true_model(name: str) -> Model:
    """The model with what was set on the rig, its valve by the rig's own law."""
    truth, volume = TRUTH[name]["parameters"], TRUTH[name]["vessel_volume"]
    values = {"friction.coulomb": truth["coulomb"], "friction.viscous": truth["viscous"]}
    if "static" in truth:
        values |= {"stribeck.static": truth["static"], "stribeck.velocity": truth["stribeck_velocity"]}
    if "piston_leak_area" in truth:
        values["piston-leak.area"] = truth["piston_leak_area"]
    if volume:
        values["rig.vessel_volume"] = volume
    effects = tuple(catalogue()[e] for e in (*TRUTH[name]["effects"], *TRUTH[name]["hidden"]))
    second = true_valve(truth, "_2") if "effective_area_2" in truth else None
    return Model(load(FIXTURES / name / "pipeline.toml").to_rig(), effects, values, true_valve(truth), second)


def true_valve(truth: dict[str, float], of: str = "") -> ValveArea:
    """The paths of one chamber: ``of`` is the ending of their names."""
    overlap, most = truth[f"overlap{of}"], truth.get("command_range", 10.0)
    u = most * np.array([0.05, 0.1, 0.2, 0.5, 1.0])
    areas = truth[f"effective_area{of}"] * ((u - overlap) / (most - overlap)) ** truth[f"exponent{of}"]
    return ValveArea((*-u[::-1], *u), (*areas[::-1], *areas), overlap, overlap)


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], list[ChannelResult]]:
    @cache
    def results(name: str) -> list[ChannelResult]:
        path, out = FIXTURES / name / "pipeline.toml", tmp_path_factory.mktemp(name)
        config = load(path)
        ingest.run(Context(path, config, out, out))
        model = true_model(name)
        ready = [
            prepare(r, model.rig, config.compare.horizon)
            for r in load_recordings(out)
            if r.name.startswith(RECORDINGS[name])
        ]
        ends = with_end_stops(ready, model.rig)
        return [r for e in ends for r in compare(model, e, expected_rms(model, e, draws=DRAWS)).results]

    return results


@pytest.mark.parametrize("name", ["valve_null", "demo"])
def test_pressures_of_a_correct_model_deviate_by_their_noise(
    name: str, compared: Callable[[str], list[ChannelResult]]
) -> None:
    ratios = {(r.recording, r.channel): r.ratio_to_noise for r in compared(name) if r.channel in PRESSURES}
    assert len(ratios) >= 5
    assert {where: ratio for where, ratio in ratios.items() if not 0.75 <= ratio <= 1.25} == {}
    assert 0.9 <= np.mean(list(ratios.values())) <= 1.1


def test_motion_of_a_correct_model_deviates_by_its_noise_on_average(
    compared: Callable[[str], list[ChannelResult]],
) -> None:
    results = [r for name in RECORDINGS for r in compared(name) if r.channel not in PRESSURES]
    # a run in which the piston rests throughout has a velocity of 0, and no noise of it
    ratios = [r.ratio_to_noise for r in results if np.isfinite(r.ratio_to_noise)]
    assert len(ratios) > 25
    assert 0.7 <= np.median(ratios) <= 1.2
    assert 0.7 <= np.mean(ratios) <= 1.25
