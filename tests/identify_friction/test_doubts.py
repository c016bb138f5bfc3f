"""What is said of a fit of friction, word for word, and when: the user acts on it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.identify.friction import identification
from pneucli.identify.friction.regression import UNITS, FrictionFit
from pneucli.identify.friction.samples import IntervalEstimate
from pneucli.messages.formatting import format_number
from pneucli.quantities import Z95
from pneucli.recording import Recording
from tests.identify_friction.test_pieces import samples

NAMES = ("coulomb", "viscous", "static", "velocity", "offset")
USUAL = {"coulomb": 12.0, "viscous": 40.0, "static": 20.0, "velocity": 0.02, "offset": 0.0}
FAST = samples([0.1, -0.1], [16.0, -16.0])
NONE: dict[Any, tuple[str, ...]] = {"A": ()}


def fitted(deviation: float = 1.0, error: float = 1.0, **values: float) -> FrictionFit:
    """A law whose parameters have 95 % intervals of +- ``error``."""
    names = tuple(n for n in NAMES if n not in values or not np.isnan(values[n]))
    theta = np.array([(USUAL | values)[n] for n in names])
    return FrictionFit(names, theta, (error / Z95) ** 2 * np.eye(len(names)), deviation)


def doubts(law: FrictionFit, lacks: Any = None) -> list[str]:
    return identification._model_a_warnings(law, FAST, lacks or NONE)


def test_of_a_law_that_describes_its_samples_nothing_is_said() -> None:
    assert doubts(fitted()) == []
    assert doubts(fitted(static=np.nan, velocity=np.nan, offset=np.nan)) == []


@pytest.mark.parametrize(("offset", "said"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True), (30.0, True)])
def test_a_constant_force_is_one_whose_interval_leaves_zero_out(offset: float, said: bool) -> None:
    told = (
        f"a constant force of {format_number(offset, 3)} N acts beside friction "
        "(or friction differs by direction, or a sensor or an area errs)"
    )
    assert doubts(fitted(offset=offset)) == [told] * said


@pytest.mark.parametrize(("coulomb", "said"), [(1.01, False), (0.99, True)])
def test_dry_friction_is_told_from_zero_where_its_interval_is_above(coulomb: float, said: bool) -> None:
    assert doubts(fitted(coulomb=coulomb)) == ["dry friction is not told from zero"] * said


@pytest.mark.parametrize(("velocity", "said"), [(0.0249, False), (0.0251, True)])
def test_a_stribeck_velocity_beyond_a_quarter_of_the_fastest_motion_leaves_static_friction_open(
    velocity: float, said: bool
) -> None:
    told = "the Stribeck velocity lies near the end of the measured velocities: static friction is uncertain"
    assert doubts(fitted(velocity=velocity)) == [told] * said


OTHERS = (
    "something acts that neither A, a function of velocity alone, nor the pipeline's effects have; if D, E or F leave "
    "less, slowing differs from speeding up; else ask pneucli diagnose"
)
LACKS = "A, a function of velocity alone, lacks hysteresis, which the pipeline's model has"
TWO = LACKS.replace("hysteresis", "hysteresis, position")


@pytest.mark.parametrize(
    ("lacks", "reason"),
    [
        ({"A": (), "D": ()}, OTHERS),
        ({"A": ("hysteresis",), "D": ("hysteresis",)}, f"{LACKS}; none of A to F has it"),
        ({"A": ("hysteresis",), "D": (), "E": ()}, f"{LACKS}; D and E have more of it"),
        ({"A": ("hysteresis", "position"), "D": ("position",), "E": ("other",)}, f"{TWO}; D have more of it"),
    ],
)
def test_why_a_leaves_more_than_noise(lacks: Any, reason: str) -> None:
    most = identification.MAX_RESIDUAL_TO_NOISE
    (told,) = doubts(fitted(most + 0.06), lacks)
    assert told == f"model A leaves {most + 0.06:.1f} times the sensors' noise of these forces: {reason}"
    assert doubts(fitted(most), lacks) == []


def level(low: float, value: float, high: float) -> Any:
    return SimpleNamespace(friction=IntervalEstimate(value, low, high, "N"))


def test_levels_of_recordings_differ_where_their_intervals_are_apart() -> None:
    assert identification._level_warnings([]) == []
    assert identification._level_warnings([level(10.0, 11.0, 12.0), level(12.0, 13.0, 14.0)]) == []
    assert identification._level_warnings([level(10.0, 11.0, 12.0), level(12.1, 13.0, 14.0)]) == [
        "kinetic friction differs between recordings (11.0 to 13.0 N): model A pools them; see each one's own level"
    ]


def test_every_parameter_has_its_unit_and_forces_and_masses_an_interval_from_zero_on() -> None:
    found = fitted(error=30.0).values()
    assert {n: v.unit for n, v in found.items()} == {
        "coulomb": "N", "viscous": "N s/m", "static": "N", "velocity": "m/s", "offset": "N",
    }  # fmt: skip
    assert UNITS["mass"] == "kg"
    assert (found["coulomb"].ci_low, found["coulomb"].ci_high) == (0.0, pytest.approx(42.0))
    assert (found["viscous"].ci_low, found["viscous"].ci_high) == (pytest.approx(10.0), pytest.approx(70.0))
    assert (found["offset"].ci_low, found["offset"].ci_high) == (pytest.approx(-30.0), pytest.approx(30.0))


def recording(kind: str, use: str = "train") -> Recording:
    return Recording(f"{kind} {use}", kind, use, np.arange(3.0), {})  # type: ignore[arg-type]


def test_friction_tests_come_before_axis_recordings_and_valve_tests_never() -> None:
    def used(*rows: Recording) -> list[str]:
        return [r.name for r in identification._friction_recordings(rows)]

    test, axis, valve = recording("friction"), recording("axis"), recording("valve")
    assert used(valve, axis, test, recording("friction", "test")) == ["friction train", "friction test"]
    assert used(valve, axis) == ["axis train"]
    for rows in ((valve,), (axis, recording("friction", "test")), ()):
        with pytest.raises(InputError) as error:
            used(*rows)
        told = error.value
        assert (told.where, told.found, told.wanted) == (
            "recordings", "no friction test to train on", 'experiment = "friction", use = "train"',
        )  # fmt: skip
