"""The manoeuvre in which two models differ most, in units of the sensors' noise."""

from __future__ import annotations

from dataclasses import replace

from pneucli.noise import NoiseModel
from pneucli.plan.bench import recorded_benches
from pneucli.plan.rivals import MIN_SEPARATION, most_discriminating_manoeuvre
from pneucli.simulate.experiment import Experiment
from tests.simulate.synthetic_experiments import held_commands, make_experiment, model, time_grid

TIME = time_grid(2.0)
NOISE = {"p1": NoiseModel(500.0), "p2": NoiseModel(500.0), "x": NoiseModel(1e-5)}


def experiments(kind: str, **signals) -> list[Experiment]:
    return [replace(make_experiment(kind, TIME, signals), noise=NOISE)]


DRIVEN = experiments("axis", u=held_commands(TIME, [4.0, -4.0], 1.0))
PUSHED = experiments("friction", p1=3e5)


def test_equal_models_are_not_separated():
    assert most_discriminating_manoeuvre(model(), model(), DRIVEN) is None


def test_a_leak_shows_within_the_commands_that_were_recorded():
    leak = model(["chamber-leak"], {"chamber-leak.area": 2e-8})
    found = most_discriminating_manoeuvre(model(), leak, DRIVEN)
    assert found is not None
    assert found.times_noise > MIN_SEPARATION
    assert found.channel in ("p1", "x")


def test_friction_that_grows_with_pressure_shows_on_a_bench_with_a_drive_of_its_own():
    grown = model(["pressure-friction"], {"pressure-friction.gain": 0.1})
    found = most_discriminating_manoeuvre(model(), grown, PUSHED)
    assert found is not None
    assert found.manoeuvre.bench.drive == "motion"
    assert found.channel == "p1"  # the motion is given, so the pressure that it needs differs


def test_a_difference_below_the_noise_is_not_called_a_separation():
    leak = model(["chamber-leak"], {"chamber-leak.area": 1e-13})
    assert most_discriminating_manoeuvre(model(), leak, DRIVEN) is None


def test_a_bench_whose_valve_was_shut_by_hand_takes_no_command():
    shut = [replace(e, recording=replace(e.recording, valve_shut=True)) for e in DRIVEN]
    assert recorded_benches(shut) == []
