"""Of candidates that explain the data equally well the simplest one is named, and the others are its equivalents."""

from dataclasses import replace

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.equivalence import best_candidate, not_inferior
from tests.diagnose.candidates import candidate, model_fit, shaky

BEFORE = model_fit(cost=400_000.0)
CONSTANT = candidate("constant-force", 100_000.0, before=BEFORE)


def rival(effect: str, fall: float, scatter: float = 0.0, than: Candidate = CONSTANT) -> Candidate:
    """A candidate whose cost is lower by ``fall`` than that of another, in every block or by scattered ones."""
    return replace(candidate(effect, before=BEFORE), full=shaky(than.full, fall, scatter, [effect]))


def test_of_equals_the_one_with_the_fewest_parameters_is_the_best():
    """3 of a chi-square of 3.84: by chance one parameter more explains as much."""
    spring = rival("spring-force", 3.0)
    assert not_inferior(CONSTANT.full, spring.full)
    assert best_candidate([spring, CONSTANT]) is CONSTANT


def test_a_reduction_in_every_block_justifies_a_parameter():
    spring = rival("spring-force", 300.0)
    assert not not_inferior(CONSTANT.full, spring.full)
    assert best_candidate([CONSTANT, spring]) is spring


def test_of_equals_with_as_many_parameters_a_sensor_comes_last():
    offset = rival("pressure-offset", 0.0)
    assert best_candidate([offset, CONSTANT]) is CONSTANT


def test_a_significantly_better_sensor_fault_is_no_equal():
    offset = rival("pressure-offset", 300.0)
    assert best_candidate([offset, CONSTANT]) is offset


def test_rounding_errors_do_not_decide_between_equivalents():
    """One parameter takes up 3.84 by chance, of a variance of 1.5; by as much in every block is certain."""
    best = model_fit(cost=6000.0)
    assert best.cost / best.residual_count == 1.5
    assert not_inferior(model_fit(cost=6005.7), best)
    assert not not_inferior(model_fit(cost=6005.9), best)
