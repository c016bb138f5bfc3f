"""Power: what else may explain an effect is projected out, recordings add, and what was known before is no merit."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pneucli.figure import read
from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.messages.diagnose import Answer
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.plan.bench import described_benches, recorded_benches
from pneucli.plan.first import typical_model
from pneucli.plan.limits import limits_of
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.power import Deviation, Expectation, detection_power, deviations_of, power_table, prior_information
from pneucli.plan.rivals import (
    DECIDED_PROBABILITY,
    MAX_RIVALS,
    MIN_PRIOR_ODDS,
    MIN_SEPARATION,
    most_discriminating_manoeuvre,
    refused_effects,
    rivals_of_diagnosis,
)
from pneucli.recording import Rig
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, with_effect
from tests.simulate.synthetic_experiments import held_commands, make_experiment, model, time_grid

RIG = Rig(supply_pressure=7e5, ambient_pressure=1e5, vessel_volume=160e-6)
EFFECTS = catalogue()
RNG = np.random.default_rng(3)
BASE = Model(RIG, (), {"friction.coulomb": 10.0})
MASS = with_effect(BASE, EFFECTS["extra-mass"], {"extra-mass.mass": 0.8})
LAG = with_effect(BASE, EFFECTS["valve-lag"], {"valve-lag.time_constant": 0.01})


def free(name: str, sigma: float = np.inf) -> FreeParameter:
    return FreeParameter(name, "N", 1.0, 0.0, 10.0, 1.0, prior_sigma=sigma)


def expectation(others: dict[str, Model], *parameters: FreeParameter, model: Model = BASE) -> Expectation:
    return Expectation(model, others, parameters, prior_information(len(others), parameters), 0.5)


def gram(*columns: np.ndarray) -> np.ndarray:
    return np.array(columns) @ np.array(columns).T


def test_the_size_over_its_error_is_that_of_the_marginal_covariance() -> None:
    """d' (1 + j s^2 j')^-1 d, computed directly."""
    d, j, sigma = RNG.standard_normal(50), RNG.standard_normal(50), 0.3
    direct = d @ np.linalg.solve(np.eye(50) + sigma**2 * np.outer(j, j), d)
    found = expectation({"extra-mass": MASS}, free("friction.coulomb", sigma)).size_over_error(gram(d, j), "extra-mass")
    assert found**2 == pytest.approx(direct)


def test_a_difference_that_an_unknown_parameter_can_make_tells_nothing() -> None:
    d = RNG.standard_normal(50)
    assert expectation({"extra-mass": MASS}, free("a.b")).size_over_error(gram(d, 2.0 * d), "extra-mass") < 1e-3


def test_what_was_known_before_frees_a_plan_of_a_doubt_but_is_no_merit_of_it() -> None:
    d, j = RNG.standard_normal((2, 50))
    alone = expectation({"extra-mass": MASS}, free("friction.coulomb"))
    same, apart = gram(d, d), gram(np.zeros(50), 1e3 * j)
    assert alone.size_over_error(same, "extra-mass") < 1e-3
    known = replace(alone, prior=alone.prior + apart)
    assert known.size_over_error(same, "extra-mass") == pytest.approx(np.linalg.norm(d), rel=1e-3)
    assert replace(alone, prior=gram(9.0 * d, j)).size_over_error(np.zeros((2, 2)), "extra-mass") == 0.0


def test_a_lag_of_the_valve_may_explain_others_up_to_its_typical_size_but_not_itself() -> None:
    d = 10.0 * np.ones(1)
    both = expectation({"extra-mass": MASS, "valve-lag": LAG})
    assert both.lags == {"valve-lag"}
    information = gram(d, d)
    assert both.size_over_error(information, "extra-mass") ** 2 == pytest.approx(100.0 / (1.0 + 100.0))
    assert both.size_over_error(information, "valve-lag") == pytest.approx(10.0)
    heavier = with_effect(LAG, EFFECTS["extra-mass"], {"extra-mass.mass": 0.8})
    assert expectation({"extra-mass": heavier}, model=LAG).lags == set()  # the model has it


def test_the_parameters_of_an_effect_in_doubt_do_not_explain_it() -> None:
    d = RNG.standard_normal(50)
    doubtful = expectation({"extra-mass": BASE}, free("extra-mass.mass"), model=MASS)
    assert doubtful.size_over_error(gram(d, d), "extra-mass") == pytest.approx(np.linalg.norm(d))


def test_the_power_is_80_percent_at_the_size_that_the_table_gives() -> None:
    at_size = expectation({"extra-mass": MASS})
    typical, least = power_table(at_size, np.array([[4.0]]))
    assert (typical.size, typical.power) == (pytest.approx(0.8), detection_power(2.0))
    share = least.size / typical.size
    assert detection_power(2.0 * share) == pytest.approx(0.8, abs=0.005)
    assert power_table(at_size, np.zeros((1, 1)))[1].size == np.inf


@pytest.mark.parametrize(("ratio", "time_constant", "variance"), [(1.0, 0.5, 1.0), (3.0, 0.0, 9.0), (3.0, 0.1, 1601.0)])
def test_a_discrepancy_counts_as_blocks_of_its_correlation_time(ratio: float, time_constant: float, variance: float):
    """At 1 kHz, 0.1 s are 2 * 0.1 / 0.001 = 200 samples a reading."""
    assert Deviation(ratio, time_constant).divisor(1e-3) ** 2 == pytest.approx(variance)


def test_the_deviation_of_a_fit_has_its_rms_and_how_long_it_lasts() -> None:
    n, length = 20_000, 100
    lasting = 3.0 * np.repeat(RNG.standard_normal(n // length), length)
    experiment = SimpleNamespace(time=np.zeros(n), recording=SimpleNamespace(period=1e-3))
    model: Any = SimpleNamespace(title="gas", channels=("p1", "x"), experiment=experiment)
    found = deviations_of([model], np.concatenate([lasting, 0.5 * np.ones(n)]))
    assert found["gas", "p1"].ratio == pytest.approx(3.0, rel=0.1)
    assert found["gas", "p1"].time_constant == pytest.approx(0.063, rel=0.2)  # of blocks: 1 - 1/e of their length
    assert found["gas", "x"] == Deviation()  # no more than noise


def test_a_recording_of_the_vessel_shows_a_leak_in_its_pressure_and_less_of_it_beside_a_discrepancy() -> None:
    (bench,) = described_benches(RIG)
    steps = next(m for m in candidate_manoeuvres(bench, limits_of(RIG, [bench])) if m.kind == "hold")
    model = typical_model(RIG, [bench])
    leak = with_effect(model, EFFECTS["chamber-leak"], {"chamber-leak.area": 1e-8})
    known = Expectation(model, {"chamber-leak": leak}, (), np.zeros((1, 1)), 5.0)
    seen = known.predict(steps, ["chamber-leak"])
    difference = seen.differences["chamber-leak"]
    assert (difference.channel, difference.values.size) == ("p1", seen.outcome.time.size)
    assert difference.rms > 1.0
    assert seen.information[0, 0] == pytest.approx(difference.values @ difference.values)
    unsure = replace(known, usual=Deviation(5.0, 0.1)).predict(steps)
    assert unsure.information[0, 0] == pytest.approx(
        seen.information[0, 0] / Deviation(5.0, 0.1).divisor(bench.period) ** 2
    )
    assert unsure.differences == {}


# --- the manoeuvre in which two models differ most, in units of the sensors' noise


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


# --- rivals: what a diagnosis names with doubt, does not tell from a name, or refused for want of better recordings


def entry(effect: str, reason: str, confidence: float = 0.003, **properties: Any) -> dict[str, Any]:
    known = {"effect": effect, "reason": reason, "confidence_alone": confidence, "supported": False}
    return known | {"parameters": {"size": {"value": 1.0}}} | properties


def test_refused_effects_that_better_recordings_may_show_are_in_question_the_most_probable_first() -> None:
    found = refused_effects(
        answer(
            entry("a leak", "vanishes"),
            entry("a lag", "not-significant"),
            entry("a scale", "raises-error", 0.5),
            entry("a mass", "at-bound", 0.4),
            entry("an offset", "contradicted-by-reading", 0.4),
            entry("a cushion", "not-promising", parameters={}),
            entry("a droop", "supported", 0.9, supported=True),
        ).candidates
    )
    assert found == [(pytest.approx(1.0), "a scale"), (MIN_PRIOR_ODDS, "a lag"), (MIN_PRIOR_ODDS, "a leak")]


def named(effect: str, confidence: float, *equivalents: str) -> dict[str, Any]:
    known = {"confidence": confidence, "indistinguishable_from": list(equivalents), "supported": True}
    return entry(effect, "supported", confidence) | known


def answer(*candidates: dict[str, Any]) -> Answer:
    missing = [c["effect"] for c in candidates if c["supported"]]
    return read(Answer, {"missing": missing, "candidates": list(candidates)})


def test_a_named_effect_is_in_question_as_far_as_it_is_doubtful_and_its_equivalents_with_it() -> None:
    others = entry("mass", "needless", 0.2), entry("droop", "needless", 0.6)
    told = answer(named("leak", 0.6, "droop"), named("lag", DECIDED_PROBABILITY), *others)
    found = rivals_of_diagnosis(told, ["leak", "lag"])
    assert [r.name for r in found] == ["droop in place of leak", "without leak", "mass"]
    assert [r.own_probability for r in found] == [0.6, pytest.approx(0.4), 0.2]


def test_the_most_probable_rivals_are_kept() -> None:
    many = [entry(f"effect {i}", "needless", 0.01 * i) for i in range(10, 30)]
    assert [r.effect for r in rivals_of_diagnosis(answer(*many), [])] == [f"effect {i}" for i in range(29, 21, -1)]
    assert MAX_RIVALS == 8


def test_effects_that_are_asked_for_are_in_question_whatever_the_diagnosis_says() -> None:
    told = answer(named("leak", 0.99), entry("mass", "at-bound", 0.2), entry("lag", "needless", 0.3))
    found = rivals_of_diagnosis(told, ["leak"], ["leak", "mass", "spring"])
    assert [(r.effect, r.present, r.probability) for r in found] == [
        ("leak", False, 0.99),
        ("mass", True, 0.2),
        ("spring", True, None),
    ]
