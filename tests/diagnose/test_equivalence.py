"""Of equals the simpler one leads; what is told beside it are its equals."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.equivalence import best_candidate, indistinguishable, is_simpler, not_inferior
from tests.diagnose.candidates import candidate, diagnosis_data, model_fit, shaky

BEFORE = model_fit(cost=400_000.0)
CONSTANT = candidate("constant-force", 100_000.0, before=BEFORE)


def rival(effect: str, fall: float, scatter: float = 0.0, than: Candidate = CONSTANT) -> Candidate:
    """A trial of the same start that leaves ``fall`` less than another, in every block or by scattered ones."""
    return replace(candidate(effect, before=BEFORE), full=shaky(than.full, fall, scatter, [effect]))


def test_an_immaterial_advantage_does_not_justify_a_parameter():
    """300 of the 300 000 that the force takes, the same in every block: sure, and no reason for one parameter more."""
    spring = rival("spring-force", 300.0)
    assert not not_inferior(CONSTANT.full, spring.full)
    assert best_candidate(diagnosis_data(), [spring, CONSTANT]) is CONSTANT


def test_a_spring_leads_where_it_leaves_much_less():
    spring = rival("spring-force", 40_000.0)
    assert best_candidate(diagnosis_data(), [CONSTANT, spring]) is spring


def test_of_equals_with_as_many_parameters_a_sensor_comes_last():
    offset = rival("pressure-offset", 0.0)
    assert best_candidate(diagnosis_data(), [offset, CONSTANT]) is CONSTANT


BOUNDS = candidate("friction-hysteresis", 100_000.0, before=BEFORE)


@pytest.mark.parametrize(("train", "test", "holds"), [(1.5, 1.5, False), (1.3, 9.0, True), (9.0, 1.3, True)])
def test_bounds_that_replay_far_worse_than_an_equal_do_not_lead(train: float, test: float, holds: bool):
    """They hold the balance of forces as well as its law does, and say little of how the piston moves."""
    law = rival("friction-asymmetry", 300.0, than=BOUNDS)
    seen = diagnosis_data([(law.full, 1.0, 1.0), (BOUNDS.full, train, test)])
    assert best_candidate(seen, [BOUNDS, law]) is (BOUNDS if holds else law)


def test_a_set_valued_law_wins_over_a_worse_fit():
    law = rival("friction-asymmetry", -5000.0, than=BOUNDS)
    seen = diagnosis_data([(law.full, 1.0, 1.0), (BOUNDS.full, 9.0, 9.0)])
    assert best_candidate(seen, [BOUNDS, law]) is BOUNDS


def test_a_point_valued_law_wins_whatever_its_free_run_error():
    """Stick-slips hang on few break-aways: of two laws the balance tells more."""
    spring = rival("spring-force", 300.0)
    seen = diagnosis_data([(spring.full, 1.0, 1.0), (CONSTANT.full, 9.0, 9.0)])
    assert best_candidate(seen, [CONSTANT, spring]) is CONSTANT


def test_a_significantly_better_sensor_fault_is_no_equal():
    offset = rival("pressure-offset", 300.0)
    assert best_candidate(diagnosis_data(), [offset, CONSTANT]) is offset


def test_materiality_is_relative_to_the_cost_and_to_the_reduction():
    """4 thousandths of 99 700 beyond noise; of a small effect 5 hundredths."""
    assert is_simpler(CONSTANT, rival("spring-force", 390.0))
    assert not is_simpler(CONSTANT, rival("spring-force", 410.0))
    faint = candidate("constant-force", 399_000.0, before=BEFORE)
    assert is_simpler(faint, rival("spring-force", 49.0, than=faint))
    assert not is_simpler(faint, rival("spring-force", 51.0, than=faint))
    assert not is_simpler(rival("spring-force", -10.0), CONSTANT)  # it has one parameter more


def test_rivals_within_chance_are_indistinguishable():
    assert indistinguishable(rival("friction-asymmetry", -4000.0), CONSTANT.full)
    assert not indistinguishable(rival("friction-asymmetry", -6000.0), CONSTANT.full)
    assert indistinguishable(rival("friction-asymmetry", -100.0, 200.0), CONSTANT.full)


def test_rounding_errors_do_not_decide_between_equivalents():
    """One parameter takes up 3.84 by chance, of a variance of 1.5; by as much in every block is certain."""
    best = model_fit(cost=6000.0)
    assert best.cost / best.residual_count == 1.5
    assert not_inferior(model_fit(cost=6005.7), best)
    assert not not_inferior(model_fit(cost=6005.9), best)
