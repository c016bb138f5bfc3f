"""A hose with a bore against the equations of its section, solved by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pneucli.physics.effects import catalogue
from pneucli.physics.sides import with_variants
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.run import run

from .synthetic_experiments import held_commands, make_experiment, model, time_grid

R, T, KAPPA, VISCOSITY = 287.0, 293.15, 1.4, 1.82e-5
C2 = KAPPA * R * T  # square of the speed of sound
VESSEL = Rig(ambient_pressure=101_300.0, supply_pressure=7e5)
VOLUME, START = 4e-4, 101_300.0
TIME = time_grid(0.3)
OPENING = held_commands(TIME, (0.0, 4.0, 4.0), 0.1)
CHOKED = 0.484 * np.sqrt(2 / (R * T)) * 7e5 * 4 / 5 * 0.9e-6  # kg/s through the benches' valve at 4 V
FUNCTIONS = build((), compiled=False).functions


def filled(**values: float) -> np.ndarray:
    """Pressure of a vessel that fills from 0.1 s on through a hose."""
    values = {f"line-delay.{name}": value for name, value in values.items()}
    filled = model(["line-delay"] if values else [], values | {"rig.vessel_volume": VOLUME}, rig=VESSEL)
    return run(filled, make_experiment("valve", TIME, {"u": OPENING, "p1": START}, rig=VESSEL))[:, at.R1]


def pressure_drop(q: float, density: float, length: float, bore: float) -> float:
    """Of Hagen and Poiseuille or of Blasius, whichever is larger, and of both ends, in Pa."""
    speed = q / (density * 0.25 * np.pi * bore**2)
    reynolds = max(density * abs(speed) * bore / VISCOSITY, 1e-9)
    dynamic = 0.5 * density * speed * abs(speed)
    return max(64.0 / reynolds, 0.316 / reynolds**0.25) * length / bore * dynamic + 1.5 * dynamic


def settled(q: float, p: float, length: float, bore: float) -> tuple[float, float]:
    """Pressure at the valve and flow after a long time with a constant flow into a constant pressure."""
    delay, base = length / np.sqrt(C2), np.zeros(len(at.BASE_NAMES))
    base[at.GAMMA], base[at.GAS], base[at.TEMP] = KAPPA, R, T
    at_valve, through = p, 0.0
    for _ in range(40_000):
        at_valve, through, *_ = FUNCTIONS.hose_step(at_valve, through, p, q, delay / 8.0, delay, bore, base)
    return at_valve, through


@pytest.mark.parametrize(
    ("delay", "bore", "differs"), [(3e-3, 3e-3, 3e-3), (6e-3, 4e-3, 3e-3), (14e-3, 6e-3, 3e-3), (2e-3, 2e-3, 2e-3)]
)
def test_a_vessel_fills_as_behind_a_section_of_a_line(delay: float, bore: float, differs: float) -> None:
    """And as behind no hose that only delays: by more than the share ``differs`` of the rise."""
    length, area = np.sqrt(C2) * delay, 0.25 * np.pi * bore**2
    half = 0.5 * length * area

    def rates(t: float, state: np.ndarray) -> list[float]:
        near, q, far = state
        density = 0.5 * (near + far) / (R * T)
        push = near - far - pressure_drop(q, density, length, bore)
        return [C2 / half * (CHOKED - q), area / length * push, C2 / (VOLUME - half) * q]

    exact = solve_ivp(
        rates, (0.0, 0.2), [START, 0.0, START], t_eval=TIME[100:] - 0.1, rtol=1e-8, atol=1e-3, max_step=1e-4
    )
    found = filled(delay=delay, bore=bore)
    rise = exact.y[2, -1] - START
    assert rise > 4e4
    assert found[100:] == pytest.approx(exact.y[2], abs=1e-3 * rise)
    assert np.abs(filled(delay=delay)[100:] - exact.y[2]).max() > differs * rise


@settings(max_examples=20, deadline=None)
@given(delay=st.floats(1e-3, 0.01), bore=st.floats(4e-3, 8e-3))
def test_a_hose_keeps_the_gas_that_enters_it(delay: float, bore: float) -> None:
    """Half of it is part of the vessel's volume and the other half stands at the valve, so both fill as one."""
    late, plain = filled(delay=delay, bore=bore), filled()
    slope = np.polyfit(TIME[200:], late[200:], 1)[0] / np.polyfit(TIME[200:], plain[200:], 1)[0]
    assert slope == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("q", [1e-7, 1e-5, -1e-5, 1e-3])
def test_steady_flow_loses_what_the_laws_of_friction_say(q: float) -> None:
    length, bore, p = 1.5, 4e-3, 5e5
    at_valve, through = settled(q, p, length, bore)
    density = 0.5 * (at_valve + p) / (R * T)
    assert through == pytest.approx(q, rel=1e-3)
    assert at_valve - p == pytest.approx(pressure_drop(q, density, length, bore), rel=1e-3, abs=1e-6)


def test_a_flow_expands_along_the_hose() -> None:
    """Of isothermal flow the squares of the pressures fall: at the density before it, the drop is a seventh smaller."""
    length, bore, p, q = 8.0, 3e-3, 3e5, 1.2e-3
    at_valve, _ = settled(q, p, length, bore)
    flux = q / (0.25 * np.pi * bore**2)
    friction = 0.316 / (flux * bore / VISCOSITY) ** 0.25 * length / bore
    assert at_valve == pytest.approx(np.sqrt(p**2 + friction * flux**2 * R * T), rel=0.01)
    assert at_valve > 1.5 * p


def test_the_hoses_of_a_cylinder_act_on_both_chambers() -> None:
    """The piston stands, and each chamber fills behind its own hose."""
    e = make_experiment("axis", TIME, {"u": OPENING, "u2": OPENING, "p1": 2e5, "p2": 2e5}, chamber_2="valve")
    e.flags[at.MECHANICS] = 0.0
    both = {"line-delay.delay": 0.006, "line-delay.bore": 0.003}
    second = {"line-delay:2.delay": 0.006, "line-delay:2.bore": 0.003}
    hoses, plain = with_variants([catalogue()["line-delay"]]), run(model(), e)
    late = run(replace(model(values=both), effects=(hoses["line-delay"],)), e)
    late_2 = run(replace(model(values=second), effects=(hoses["line-delay:2"],)), e)
    for column in (at.P1, at.P2):
        assert np.abs(late[:, column] - plain[:, column]).max() > 1e3
    assert late_2[:, at.P1] == pytest.approx(plain[:, at.P1], rel=1e-3)
    assert late_2[:, at.P2] == pytest.approx(late[:, at.P2], rel=1e-3)
