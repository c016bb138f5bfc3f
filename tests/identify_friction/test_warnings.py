"""Warnings about identified friction, and the parameters that they rest on."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.figure import Figure
from pneucli.identify.friction import identification
from pneucli.identify.friction.identification import level_warnings, model_a_warnings
from pneucli.identify.friction.regression import UNITS, FrictionFit
from pneucli.identify.friction.samples import MovingSamples
from pneucli.messages.findings import Finding
from pneucli.quantities import Z95
from pneucli.recording import Recording

NAMES = ("coulomb", "viscous", "static", "velocity", "offset")
USUAL = {"coulomb": 12.0, "viscous": 40.0, "static": 20.0, "velocity": 0.02, "offset": 0.0}
SPEED, FORCE = np.array([0.1, -0.1]), np.array([16.0, -16.0])
FAST = MovingSamples(SPEED, 0.0 * SPEED, FORCE, FORCE, np.ones(2), np.ones(2, np.int8), np.arange(2))
NONE: dict[Any, tuple[str, ...]] = {"A": ()}


def fitted(deviation: float = 1.0, error: float = 1.0, **values: float) -> FrictionFit:
    """A friction model whose parameters have 95 % intervals of +- ``error``."""
    names = tuple(n for n in NAMES if n not in values or not np.isnan(values[n]))
    theta = np.array([(USUAL | values)[n] for n in names])
    return FrictionFit(names, theta, (error / Z95) ** 2 * np.eye(len(names)), deviation)


def warned(fit: FrictionFit, unmodelled: Any = None) -> list[Finding]:
    return list(model_a_warnings(fit, FAST, unmodelled or NONE))


def kinds(fit: FrictionFit) -> list[str]:
    return [warning.code for warning in warned(fit)]


def test_a_model_that_describes_its_samples_has_no_warning() -> None:
    assert warned(fitted()) == []
    assert warned(fitted(static=np.nan, velocity=np.nan, offset=np.nan)) == []


@pytest.mark.parametrize(
    ("offset", "expected"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True), (30.0, True)]
)
def test_a_constant_force_is_significant_where_its_interval_excludes_zero(offset: float, expected: bool) -> None:
    assert warned(fitted(offset=offset)) == [Finding("force-offset", {"force": offset})] * expected


@pytest.mark.parametrize(("coulomb", "expected"), [(1.01, False), (0.99, True)])
def test_dry_friction_is_significant_where_its_interval_lies_above_zero(coulomb: float, expected: bool) -> None:
    assert kinds(fitted(coulomb=coulomb)) == ["dry-friction-not-significant"] * expected


@pytest.mark.parametrize(("velocity", "expected"), [(0.0249, False), (0.0251, True)])
def test_static_friction_is_uncertain_with_a_stribeck_velocity_beyond_a_quarter_of_the_highest_speed(
    velocity: float, expected: bool
) -> None:
    assert kinds(fitted(velocity=velocity)) == ["static-friction-uncertain"] * expected


@pytest.mark.parametrize(
    ("unmodelled", "better"),
    [
        ({"A": (), "D": ()}, []),
        ({"A": ("hysteresis",), "D": ("hysteresis",)}, []),
        ({"A": ("hysteresis",), "D": (), "E": ()}, ["D", "E"]),
        ({"A": ("hysteresis", "position"), "D": ("position",), "E": ("other",)}, ["D"]),
    ],
)
def test_a_misfit_names_the_effects_that_a_cannot_represent_and_the_models_that_can(
    unmodelled: Any, better: list[str]
) -> None:
    limit = identification.MAX_RESIDUAL_TO_NOISE
    (misfit,) = warned(fitted(limit + 0.06), unmodelled)
    assert (misfit.code, misfit.values["ratio"]) == ("misfit", limit + 0.06)
    assert (misfit.values["unmodelled"], misfit.values["better"]) == (unmodelled["A"], better)
    assert warned(fitted(limit), unmodelled) == []


def level(low: float, value: float, high: float) -> Any:
    return SimpleNamespace(friction=Figure(value, low, high, "N"))


def test_levels_of_recordings_differ_where_their_intervals_are_apart() -> None:
    assert list(level_warnings([])) == []
    assert list(level_warnings([level(10.0, 11.0, 12.0), level(12.0, 13.0, 14.0)])) == []
    assert list(level_warnings([level(10.0, 11.0, 12.0), level(12.1, 13.0, 14.0)])) == [
        Finding("levels-differ", {"lowest": 11.0, "highest": 13.0})
    ]


def test_every_parameter_has_its_unit_and_forces_and_masses_an_interval_from_zero_on() -> None:
    found = fitted(error=30.0).values()
    assert {n: v.unit for n, v in found.items()} == {
        "coulomb": "N", "viscous": "N s/m", "static": "N", "velocity": "m/s", "offset": "N",
    }  # fmt: skip
    assert UNITS["mass"] == "kg"
    assert (found["coulomb"].low, found["coulomb"].high) == (0.0, pytest.approx(42.0))
    assert (found["viscous"].low, found["viscous"].high) == (pytest.approx(10.0), pytest.approx(70.0))
    assert (found["offset"].low, found["offset"].high) == (pytest.approx(-30.0), pytest.approx(30.0))


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
