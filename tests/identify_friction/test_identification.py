"""What the identification as a whole hands over, and what it asks for."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.friction.identification import identify_friction
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from tests.identify_friction.synthetic_recordings import (
    BENCH,
    FIXTURES,
    RIG,
    identified,
    load,
    pressed,
    pulses,
    recorded,
)

STICKY = BENCH._replace(static=18.0, stribeck_velocity=0.015)


@cache
def run() -> Recording:
    return recorded(STICKY, pressed(STICKY, pulses(2, 30.0)), 1)


def test_everything_for_tables_and_figures_is_there() -> None:
    found = identified(FIXTURES / "friction_null_stribeck")
    assert [m.name for m in found.models] == list("ABCDEF")
    assert [c.branch for c in found.curves] == ["accelerating", "slowing", "both"]
    assert found.stick_slips
    assert found.averages
    assert [k.recording for k in found.kinetic] == ["driven_1", "driven_2"]  # those that stroke both ways
    assert found.model("D").title.startswith("Stribeck")


def test_measured_curves_contain_the_true_friction_within_their_intervals() -> None:
    found = identified(FIXTURES / "friction_null_stribeck")
    model = found.model("A")
    for curve in found.curves:
        clear = np.abs(curve.v) > 0.02  # where the law is steep, the mean over a bin is not the law at its middle
        inside = (curve.ci_low <= model.force(curve.v)) & (model.force(curve.v) <= curve.ci_high)
        assert np.mean(inside[clear]) > 0.85


def test_test_recordings_are_not_fitted_to() -> None:
    recordings, rig = load(FIXTURES / "friction_null_coulomb")
    spoilt = [r if r.use == "train" else _spoilt(r) for r in recordings]
    assert identify_friction(spoilt, Model(rig)).parameters == identified(FIXTURES / "friction_null_coulomb").parameters


def _spoilt(recording):  # type: ignore[no-untyped-def]
    return replace(recording, signals={**recording.signals, "p1": recording["p1"] + 5e4})


def test_axis_recordings_serve_where_there_is_no_friction_test() -> None:
    found = identify_friction([replace(run(), experiment="axis")], Model(RIG))
    assert found.parameters["coulomb"].value == pytest.approx(12.0, rel=0.03)


def test_a_constant_force_is_identifiable_only_from_both_directions() -> None:
    rising = pressed(STICKY, np.abs(pulses(2, 30.0)) * 0.8)
    one_way = identify_friction([recorded(STICKY, rising, 2)], Model(RIG))
    assert "offset" not in one_way.parameters
    assert "one-direction" in {warning.code for warning in one_way.warnings}


def test_the_grid_is_the_users_to_choose() -> None:
    found = identify_friction([run()], Model(RIG), nodes=400, max_velocity=0.05, sign_steepness=2000.0)
    grid = found.model("E").branches[0].tp.grids[0]
    assert grid.size == 400
    assert grid[[0, -1]] == pytest.approx([-0.05, 0.05])
    assert found.domain.eta == 2000.0
    assert found.model("A").force(np.array([1.0])) == pytest.approx(found.model("A").force(np.array([0.05])))


def test_what_cannot_be_identified_is_said() -> None:
    with pytest.raises(InputError, match="no friction test to train on"):
        identify_friction([replace(run(), use="test")], Model(RIG))
    resting = recorded(BENCH, pressed(BENCH, np.zeros(500)), 3)
    with pytest.raises(InputError, match="moving samples"):
        identify_friction([resting], Model(RIG))
    with pytest.raises(InputError, match="friction model"):
        identify_friction([run()], Model(RIG)).model("G")


def test_a_piston_that_stands_on_an_end_throughout_shows_no_friction() -> None:
    model = Model(replace(RIG, stroke=1.0))
    moving = run()
    noise = 1e-6 * np.random.default_rng(5).standard_normal(moving.time.size)
    signals = {name: y for name, y in moving.signals.items() if name not in ("v", "a")}
    standing = replace(moving, name="standing", signals={**signals, "x": 1.0 + noise})
    found = identify_friction([moving, standing], model)
    assert [m.recording.name for m in found.motions] == [moving.name]
    with pytest.raises(InputError, match="0 moving samples"):
        identify_friction([standing], model)


def test_a_mass_left_out_is_identified() -> None:
    found = identify_friction([run()], Model(replace(RIG, moving_mass=None)))
    assert found.mass is not None
    assert found.mass.value == pytest.approx(2.0, rel=0.03)
