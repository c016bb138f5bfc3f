"""Manoeuvres as models predict them: on a vessel, under a position loop, on a bench with its own drive."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.physics.effects import catalogue
from pneucli.plan.bench import Bench, Manoeuvre, described_benches, sample
from pneucli.plan.first import typical_model
from pneucli.plan.limits import limits_of, violations
from pneucli.plan.manoeuvres import SPEED_SHARE, candidate_manoeuvres, manual_manoeuvres
from pneucli.plan.simulation import needed_force, simulate_manoeuvre, synthetic_recording
from pneucli.recording import Rig
from pneucli.simulate.model import Model
from pneucli.simulate.run import kernel_for, run
from tests.simulate.synthetic_experiments import make_experiment, model, time_grid

RIG = Rig(
    supply_pressure=7e5,
    ambient_pressure=1e5,
    piston_area_1=8e-4,
    stroke=0.2,
    dead_volume_1=3e-5,
    dead_volume_2=3e-5,
    moving_mass=2.0,
    vessel_volume=160e-6,
    valve_null=5.0,
    valve_arrangement="5/3",
)
BENCHES = described_benches(RIG)
VESSEL = next(b for b in BENCHES if b.template.kind.vessel)
LOOP = next(b for b in BENCHES if b.drive == "position")
VALVE = next(b for b in BENCHES if b.drive == "valve" and b.template.kind.axis)
DRIVE = replace(LOOP, drive="motion", template=replace(LOOP.template, experiment="friction", chamber_2="closed"))
LIMITS = limits_of(RIG, BENCHES)
MODEL = typical_model(RIG, BENCHES)


def manoeuvre(bench: Bench, kind: str, **properties: float):
    found = [*candidate_manoeuvres(bench, LIMITS), *manual_manoeuvres(bench, LIMITS)]
    return next(m for m in found if m.kind == kind and all(getattr(m, n) == v for n, v in properties.items()))


@pytest.mark.parametrize("bench", BENCHES, ids=lambda b: f"{b.name}-{b.drive}")
def test_every_manoeuvre_begins_and_ends_at_rest_within_the_range_of_commands(bench: Bench):
    for one in candidate_manoeuvres(bench, LIMITS):
        values = sample(one.profile, 1e-3)
        assert values[0] == bench.middle
        assert values[-1] == pytest.approx(bench.middle)
        if bench.drive == "valve":
            assert np.abs(values - RIG.valve_null).max() <= 5.0 + 1e-9
        else:
            assert LIMITS.position[0] <= values.min() <= values.max() <= LIMITS.position[1]


def test_strokes_reach_nearly_the_whole_range_that_is_allowed():
    low, high = LIMITS.position
    reached = [sample(m.profile, 1e-3) for m in candidate_manoeuvres(LOOP, LIMITS) if m.kind == "strokes"]
    assert max(x.max() for x in reached) > high - 0.06 * (high - low)
    assert min(x.min() for x in reached) < low + 0.06 * (high - low)


@pytest.mark.parametrize("max_speed", [0.05, 0.3, 1.0])
def test_no_motion_is_commanded_faster_than_the_share_of_the_highest_speed(max_speed: float):
    limits = limits_of(RIG, BENCHES, {"max_speed": max_speed})
    for one in candidate_manoeuvres(LOOP, limits):
        speed = np.abs(np.diff(sample(one.profile, 1e-3))).max() / 1e-3
        assert speed <= SPEED_SHARE * max_speed * 1.01, one.kind


def test_random_steps_reach_both_sides_and_are_the_same_in_every_plan():
    first, again = (manoeuvre(VESSEL, "random-steps", level=5.0) for _ in range(2))
    assert first.profile == again.profile
    levels = np.array([s.start for s in first.profile[1:-1]]) - RIG.valve_null
    assert levels.min() < -2.5
    assert levels.max() > 2.5
    assert all(0.05 <= s.duration <= 0.6 for s in first.profile[1:-1])


def test_a_switching_valve_is_fully_open_or_shut_and_follows_no_proportional_loop():
    rig = replace(RIG, valve_kind="switching", valve_null=0.0)
    benches = described_benches(rig, 24.0)
    assert {b.drive for b in benches} == {"valve"}
    limits = limits_of(rig, benches, {"max_command": 5.0})  # a part of 24 V opens no switching valve
    for bench in benches:
        listed = list(candidate_manoeuvres(bench, limits))
        assert {m.kind for m in listed} == {"pulses", "hold"}
        for one in listed:
            assert set(sample(one.profile, 1e-3)) <= {-24.0, 0.0, 24.0}


def test_the_vessel_is_filled_to_the_supply_and_vented_to_ambient():
    outcome = simulate_manoeuvre(manoeuvre(VESSEL, "steps", level=5.0), MODEL)
    assert outcome.p1.max() == pytest.approx(7e5, rel=0.02)
    assert outcome.p1[-1] == pytest.approx(1e5, rel=0.05)
    assert outcome.air > 0.0


def test_the_position_loop_follows_its_reference_from_rest_at_the_null_command():
    outcome = simulate_manoeuvre(manoeuvre(LOOP, "motion-sine", frequency=0.25), MODEL)
    assert outcome.x is not None
    reference = outcome.readings["x_ref"]
    assert outcome.readings["u"][0] == pytest.approx(RIG.valve_null, abs=0.05)
    moved, asked = np.ptp(outcome.x), np.ptp(reference)
    assert 0.2 * asked < moved < 1.2 * asked


def test_a_pulse_moves_the_piston_toward_the_end_that_its_sign_says():
    fills = simulate_manoeuvre(next(m for m in candidate_manoeuvres(VALVE, LIMITS) if m.kind == "hold"), MODEL)
    assert fills.x is not None
    assert fills.x[-1] > fills.x[0]


def test_a_manoeuvre_runs_in_the_compiled_kernel_of_recordings():
    """Compiling another one would take longer than the plan."""
    run(model(), make_experiment("axis", time_grid(0.1), {"u": 1.0}))
    compiled = len(kernel_for(()).run.signatures)  # type: ignore[attr-defined]
    simulate_manoeuvre(manoeuvre(LOOP, "motion-sine", frequency=0.25), MODEL)
    assert len(kernel_for(()).run.signatures) == compiled  # type: ignore[attr-defined]


def test_a_shut_valve_keeps_the_pressure_of_a_tight_chamber_and_shows_a_leak():
    shut = manoeuvre(VALVE, "shut-valve")
    leak = replace(MODEL, effects=(catalogue()["chamber-leak"],), values={**MODEL.values, "chamber-leak.area": 2e-8})
    tight, leaking = (simulate_manoeuvre(shut, m) for m in (MODEL, leak))
    assert np.ptp(tight.p1) < 1.0
    assert leaking.p1[0] - leaking.p1[-1] > 1e4
    assert synthetic_recording(shut, tight, "plan", 0).valve_shut


def test_the_force_of_an_imposed_motion_is_that_of_mass_and_friction():
    model = Model(RIG, (), {"friction.coulomb": 10.0, "friction.viscous": 50.0})
    n = 100
    motion = np.full(n, 0.1), np.full(n, 0.2), np.full(n, 3.0)
    force = needed_force(model, LOOP, motion, (np.full(n, 3e5), np.full(n, 3e5)))
    assert force == pytest.approx(2.0 * 3.0 + 10.0 + 50.0 * 0.2)


def test_a_bench_with_its_own_drive_gets_the_pressure_that_the_model_needs():
    sine = next(m for m in candidate_manoeuvres(DRIVE, LIMITS) if m.kind == "motion-sine" and m.frequency == 1.0)
    outcome = simulate_manoeuvre(sine, MODEL)
    assert outcome.x is not None
    assert outcome.p2 is not None
    a = np.gradient(np.gradient(outcome.x, DRIVE.period), DRIVE.period)
    net = 8e-4 * (outcome.p1 - outcome.p2)
    friction_force = net - 2.0 * a
    moving = np.abs(outcome.v) > 0.01
    expected = np.sign(outcome.v) * MODEL.values["friction.coulomb"] + MODEL.values["friction.viscous"] * outcome.v
    assert friction_force[moving] == pytest.approx(expected[moving], abs=0.5)


def test_what_exceeds_a_limit_in_the_simulation_is_found():
    fast = manoeuvre(VALVE, "command-sine", frequency=10.0)
    outcome = simulate_manoeuvre(fast, MODEL)
    assert violations(outcome, replace(LIMITS, max_speed=0.01), RIG)


@pytest.mark.parametrize("bench", [LOOP, DRIVE], ids=["valve", "the bench's drive"])
def test_a_weight_pulls_and_moves_along(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    hung = manoeuvre(bench, "known-force")
    assert (abs(hung.force), hung.added_mass) == (pytest.approx(19.62), pytest.approx(2.0))
    outcome = simulate_manoeuvre(hung, MODEL)
    assert synthetic_recording(hung, outcome, "plan_1", 0).added_mass == pytest.approx(2.0)
    monkeypatch.setattr(Manoeuvre, "added_mass", 0.0)
    heavier = simulate_manoeuvre(hung, replace(MODEL, rig=replace(RIG, moving_mass=4.0)))
    assert outcome.p1 == pytest.approx(heavier.p1)
    assert outcome.p1 != pytest.approx(simulate_manoeuvre(hung, MODEL).p1)
