"""The virtual axes of ``benchmarks.world`` keep mass and energy, converge, and write what a truth needs."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.axis import COARSE_STEP, KAPPA, STEP, R, at_rest, gains_of, healthy_rig, record
from benchmarks.cases import truth_of
from benchmarks.world import Built, Fault, faulty, make, parameters_of, truth, without

PERIOD, SAMPLES = 1e-3, 600


def rig(family="press"):
    return healthy_rig(family, np.random.default_rng(5))


def after(rigs, state, rest, command, step):
    second = np.zeros(command.size)
    return record(
        rigs, state, command, second, False, gains_of(rigs[0], rest), (-9.0, 9.0), PERIOD, round(PERIOD / step)
    )[0]


def closed(rigs):
    for name in ("C_leak", "pleak", "leak", "h0", "visc", "force"):
        rigs[name] = 0.0
    rigs["Fc"], rigs["Fs"], rigs["ov_s"], rigs["ov_e"] = 1e-9, 1e-9, 0.99, 0.99
    return rigs


def test_a_closed_axis_keeps_its_mass_and_without_hoses_its_energy() -> None:
    rigs, rest = rig()
    r = closed(rigs)[0]
    r.D = 1e-4  # hardly any gas passes: in a hose it loses heat
    state = at_rest(r, 0.4 * r.stroke)
    y = state[0]
    y.v = 0.1

    def content():
        gas = y.U.sum() + r.pamb * (r.A[0] - r.A[1]) * y.x
        return gas + y.hU.sum() + 0.5 * r.mass * y.v**2, y.m.sum() + y.hm.sum()

    (energy, mass), kinetic = content(), 0.5 * r.mass * 0.1**2
    after(rigs, state, rest, np.zeros(SAMPLES), STEP)
    assert content()[0] == pytest.approx(energy, abs=5e-3 * kinetic)
    assert content()[1] == pytest.approx(mass, rel=1e-12)


def test_an_axis_that_stands_passes_no_gas() -> None:
    rigs, rest = rig("clamp")
    state = at_rest(rigs[0], 0.5 * rigs[0].stroke)
    rigs["C_leak"] = 0.0
    rigs["ov_s"], rigs["ov_e"] = 0.05, 0.05
    mass = (state[0].m.sum() + state[0].hm.sum()).item()
    after(rigs, state, rest, np.zeros(3000), STEP)
    assert state[0].m.sum() + state[0].hm.sum() == pytest.approx(mass, rel=1e-12)
    assert np.abs(state[0].hq).max() < 1e-5 * rigs["C_s"].min() * 1.185 * state[0].ps  # the chambers still cool
    assert abs(state[0].v) < 1e-6


@pytest.mark.parametrize("family", ["gantry", "press", "clamp", "fast"])
def test_half_the_step_changes_less_than_the_sensors_see(family) -> None:
    rigs, rest = rig(family)
    t = PERIOD * np.arange(SAMPLES)
    command = 0.1 * np.sign(np.sin(2.0 * np.pi * 4.0 * t))
    coarse, fine = (
        after(rigs, at_rest(rigs[0], 0.5 * rigs[0].stroke), rest, command, step) for step in (COARSE_STEP, STEP)
    )
    off = np.sqrt(np.mean((coarse - fine) ** 2, axis=0))
    assert off[0] < 3e-5
    assert off[1:3].max() < 150.0


def test_an_effect_changes_the_rig_as_its_truth_says() -> None:
    rigs, rest = rig()
    fault = Fault("valve-leak", np.full((3, 2), 0.5))
    bad = faulty(rigs, [fault], rest["leans"])
    low, high = parameters_of(fault, bad, rigs, rest["full"])["area"]
    supply, area = 6e5, 0.5 * (low + high)
    choked = np.sqrt(KAPPA / (R * 293.15)) * (2.0 / (KAPPA + 1.0)) ** ((KAPPA + 1.0) / (2.0 * KAPPA - 2.0))
    assert bad["C_leak"][0] * 1.185 * supply == pytest.approx(area * supply * choked, rel=1e-3)
    assert without(bad, rigs, fault)["C_leak"][0] == rigs["C_leak"][0]
    assert "valve-leak" not in truth(Built(rigs, bad, rest, [fault]))["present_small"]


def test_a_case_says_what_is_true_of_it(tmp_path: Path) -> None:
    make(tmp_path / "gantry-01", "gantry", 1, 2, (1.1, 1.2))
    written = json.loads((tmp_path / "gantry-01" / "truth.json").read_text(encoding="utf-8"))
    read = truth_of(written)
    without_size = {"presliding", "heat-transfer", "critical-ratio"}
    assert read.hidden == set(written["hidden"]) == set(written["parameters"])
    assert all(written["parameters"][name] for name in read.hidden - without_size)
    assert not read.hidden & read.mild
    text = (tmp_path / "gantry-01" / "pipeline.toml").read_text(encoding="utf-8")
    for path in (tmp_path / "gantry-01" / "raw").iterdir():
        assert f'file = "raw/{path.name}"' in text
