"""Each step of the search: who leads, what is dropped, which rungs stand, and what becomes of every effect tried."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pneucli.diagnose import next_term, selection
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.candidate import Candidate, Decision
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.score import FittedModel
from pneucli.identify.residuals import ChamberPressures, ForceBalance
from tests.diagnose.candidates import candidate, diagnosis_data, model_fit

BEFORE = model_fit()


@pytest.fixture(autouse=True)
def nothing_left(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (selection, next_term):
        monkeypatch.setattr(module, "lack_of_fit", lambda diagnosis_data, model_fit: ([], []))


def decision(tried: Candidate) -> Decision:
    return Decision(tried.effect, "supported", tried)


@pytest.mark.parametrize(
    ("after", "reason"),
    [
        ((2.0, 2.1), "supported"),
        ((10.1, 12.1), "raises-error"),  # both rise, if by little
        ((9.0, 30.0), "raises-error"),  # one falls and the mean rises by far more than chance
        ((9.9, 12.1), "supported"),  # one rises by what chance may
        ((2.0, None), "supported"),
        ((10.1, None), "raises-error"),
    ],
)
def test_a_candidate_that_raises_the_free_run_error_is_refused(after: tuple[float, float | None], reason: str):
    tried = candidate("extra-mass", before=BEFORE)
    where = diagnosis_data([(BEFORE, 10.0, None if after[1] is None else 12.0), (tried.full, *after)])
    leader, (decided,) = next_term.next_term(where, [decision(tried)])
    assert decided.reason == reason
    assert (leader is tried) == (reason == "supported")


@pytest.mark.parametrize(
    ("cost", "after", "reason"),
    [
        (4000.0, (1.06, 1.06), "immaterial"),  # noise is left: from 1.10 to 1.06 the error moves by itself
        (4000.0, (1.0, 1.0), "supported"),
        (8000.0, (1.06, 1.06), "supported"),
    ],
)
def test_at_the_noise_floor_the_free_run_error_must_fall_clearly(cost: float, after, reason: str):
    """A healthy model: a mass of 5 g more, for sure, and nothing that a user would see."""
    start = model_fit(cost=cost)
    tried = candidate("extra-mass", 0.9 * cost, before=start, ends={"mass": (0.005, False)})
    where = diagnosis_data([(start, 1.1, 1.1), (tried.full, *after)])
    assert next_term.next_term(where, [decision(tried)])[1][0].reason == reason


def test_the_second_best_candidate_follows_a_refused_one():
    best, second = candidate("extra-mass", 3000.0, before=BEFORE), candidate("stribeck", 5000.0, before=BEFORE)
    where = diagnosis_data([(BEFORE, 10.0, 10.0), (best.full, 11.0, 11.0), (second.full, 5.0, 5.0)])
    leader, decisions = next_term.next_term(where, [decision(best), decision(second)])
    assert leader is second
    assert [d.reason for d in decisions] == ["raises-error", "supported"]


@pytest.mark.parametrize(
    ("kind", "chance", "leads"),
    [
        (ForceBalance, 0.4, False),
        (ForceBalance, 0.6, True),
        (ChamberPressures, 0.6, True),
        (ChamberPressures, 0.4, True),
        (None, 0.4, True),
    ],
)
def test_a_set_valued_law_that_leaves_a_force_must_be_probable(monkeypatch, kind, chance, leads: bool):
    """Between two branches of friction any force stays hidden; another effect, however small, may lead then."""
    bounds, other = (
        candidate("friction-hysteresis", 1000.0, before=BEFORE),
        candidate("stribeck", 5000.0, before=BEFORE),
    )
    where = diagnosis_data([(BEFORE, 10.0, 10.0), (bounds.full, 3.0, 3.0), (other.full, 5.0, 5.0)])
    left = [LackOfFit(kind, "force", 9.0, 9.0, ())] if kind else []
    monkeypatch.setattr(next_term, "lack_of_fit", lambda diagnosis_data, model_fit: (left, []))
    monkeypatch.setattr(
        next_term, "posterior_probability", lambda diagnosis_data, place: chance if place.candidate is bounds else 0.3
    )
    monkeypatch.setattr(
        next_term, "log_odds_among_equivalents", lambda diagnosis_data, one: 0.6 if one is bounds else 0.5
    )
    leader, decisions = next_term.next_term(where, [decision(bounds), decision(other)])
    assert leader is (bounds if leads else other)
    assert decisions[0].reason == ("supported" if leads else "explained-by-unknown")


def test_without_a_supported_candidate_none_is_selected():
    tried = candidate("extra-mass", before=BEFORE)
    assert next_term.next_term(diagnosis_data(), [Decision(tried.effect, "at-bound", tried)])[0] is None


class Climbing(DiagnosisData):
    """A bench on which every set of effects has its state, and adding is looking it up."""

    def of(self, names: tuple[str, ...]) -> FittedModel:
        return self.__dict__["states"][frozenset(names)]

    def refit_with(self, before: FittedModel, effects, ranked=()) -> list[Candidate]:
        return [
            replace(candidate(e.name, before=before), full=self.of((*before.effect_names, e.name))) for e in effects
        ]

    def has_initial_guess(self, before: FittedModel, effect) -> bool:
        return effect.name not in self.__dict__["unsized"]

    def candidate(self, before: FittedModel, after: FittedModel, effect) -> Candidate:
        return replace(candidate(effect.name, before=before), full=after)


def climbing(*rows: tuple[str, float, float, float], unsized: str = "") -> Climbing:
    """A bench of rows: effects, cost, errors on training and on test."""
    states = {frozenset(names.split()): model_fit(names.split(), cost) for names, cost, _, _ in rows}
    shown = [(states[frozenset(names.split())], train, test) for names, _, train, test in rows]
    made = diagnosis_data(shown)
    lent = Climbing(made.train, made.held_out, made.effects, free_run_errors=made.free_run_errors)
    lent.__dict__["states"], lent.__dict__["unsized"] = states, unsized
    return lent


MASS, LAG = "extra-mass", "pressure-lag"


def test_no_step_raises_both_errors_even_with_the_lowest_cost():
    """The lag alone leaves less cost and raises both errors; after the mass it lowers them."""
    where = climbing(
        ("", 9000.0, 10.0, 10.0),
        (MASS, 6000.0, 8.0, 8.0),
        (LAG, 5000.0, 11.0, 11.0),
        (f"{MASS} {LAG}", 4000.0, 1.0, 1.0),
    )
    base, last = where.of(()), where.of((MASS, LAG))
    rungs, refused = selection._reordered_path(where, base, last, [base, where.of((LAG,)), last])
    assert [s.effect_names for s in rungs] == [[], [MASS], [MASS, LAG]]
    assert refused == []


def test_an_effect_without_an_initial_guess_anywhere_is_refused():
    """Two that each have a size only beside the other one, or beside what is no longer there."""
    where = climbing(("", 9000.0, 9.0, 9.0), (f"{MASS} {LAG}", 4000.0, 1.0, 1.0), unsized=f"{MASS} {LAG}")
    rungs, refused = selection._reordered_path(where, where.of(()), where.of((MASS, LAG)), [where.of(())])
    assert [s.effect_names for s in rungs] == [[]]
    assert {(d.effect.name, d.reason) for d in refused} == {(MASS, "cannot-show"), (LAG, "cannot-show")}


def test_an_effect_that_raises_the_errors_everywhere_is_refused():
    """As on a rig with several small unknowns: each step fits better by itself, and the whole gets worse."""
    where = climbing(
        ("", 9000.0, 87.3, 72.6),
        (MASS, 6000.0, 32.6, 29.4),
        (LAG, 8000.0, 90.0, 80.0),
        (f"{MASS} {LAG}", 4000.0, 38.0, 34.1),
    )
    base, last = where.of(()), where.of((MASS, LAG))
    rungs, refused = selection._reordered_path(where, base, last, [base, where.of((MASS,)), last])
    assert [s.effect_names for s in rungs] == [[], [MASS]]
    assert [(d.effect.name, d.reason) for d in refused] == [(LAG, "raises-error")]


def test_a_sound_path_is_unchanged():
    where = climbing(("", 9000.0, 10.0, 10.0), (MASS, 6000.0, 8.0, 8.0))
    known = [where.of(()), where.of((MASS,))]
    assert selection._reordered_path(where, known[0], known[1], known) == (known, [])


@pytest.mark.parametrize(("stands", "kept"), [(set(), [MASS]), ({LAG}, [MASS, LAG])])
def test_a_needless_effect_is_dropped(monkeypatch: pytest.MonkeyPatch, stands: set[str], kept: list[str]):
    """Without the lag nothing is missed, without the mass very much: that stays, and the lag if it passes its tests."""
    where = climbing(("", 9000.0, 9.0, 9.0), (MASS, 5000.0, 5.0, 5.0), (LAG, 8000.0, 8.0, 8.0))
    last = model_fit([MASS, LAG], 4999.0)
    monkeypatch.setattr(
        Climbing,
        "refit_without",
        lambda self, model_fit, effects: [
            self.of(tuple(n for n in model_fit.effect_names if n != e.name)) for e in effects
        ],
        raising=False,
    )
    monkeypatch.setattr(
        selection, "passing_candidates", lambda diagnosis_data, before, ts: [t for t in ts if t.effect.name in stands]
    )
    found, refused, _ = selection._without_needless(where, where.of(()), last)
    assert found.effect_names == kept
    assert [(d.effect.name, d.reason) for d in refused] == [(LAG, "needless")] * (LAG not in kept)


def test_a_model_without_one_of_its_effects_is_fitted_once(monkeypatch: pytest.MonkeyPatch):
    """What tells whether an effect is needless is where its rivals start, too."""
    where = climbing(
        ("", 9000.0, 9.0, 9.0), (MASS, 5000.0, 5.0, 5.0), (LAG, 8000.0, 8.0, 8.0), (f"{MASS} {LAG}", 3000.0, 3.0, 3.0)
    )
    last, asked, started = where.of((MASS, LAG)), [], {}

    def without(self: Climbing, model_fit: FittedModel, effects) -> list[FittedModel]:
        asked.extend(e.name for e in effects)
        return [self.of(tuple(n for n in model_fit.effect_names if n != e.name)) for e in effects]

    def tried(
        diagnosis_data: DiagnosisData, before: FittedModel, names: list[str], named: FittedModel
    ) -> list[Decision]:
        started[names[0]] = before.effect_names
        assert named is last
        return []

    monkeypatch.setattr(Climbing, "refit_without", without, raising=False)
    monkeypatch.setattr(selection, "passing_candidates", lambda diagnosis_data, before, candidates: candidates)
    monkeypatch.setattr(selection, "screen_and_refit", tried)
    _, places, _ = selection._revise(where, [where.of(()), where.of((MASS,)), last], [[], []])
    assert sorted(asked) == sorted([MASS, LAG])
    assert started == {MASS: [LAG], LAG: [MASS]}
    assert list(places) == [MASS, LAG]


def test_everything_that_was_screened_has_one_decision():
    names = ["extra-mass", "stribeck", "pressure-lag", "time-skew", "constant-force", "end-cushion"]
    mass, rise, lag, skew, force, cushion = (candidate(n) for n in names)
    first = [
        decision(mass),
        decision(rise),
        Decision(lag.effect, "at-bound", lag),
        Decision(cushion.effect, "not-promising"),
    ]
    second = [
        Decision(lag.effect, "not-significant", lag),
        Decision(skew.effect, "vanishes", skew),
        Decision(cushion.effect, "immaterial", cushion),
    ]
    refused = [Decision(force.effect, "needless", force)]
    found = selection.final_decisions([first, second], refused, ["extra-mass"])
    assert {d.effect.name: d.reason for d in found} == {
        "constant-force": "needless",  # it was taken, and dropped later
        "stribeck": "needless",  # it passed alone
        "pressure-lag": "at-bound",  # against the model that lacked most
        "end-cushion": "immaterial",  # a fit says more than a screen
        "time-skew": "vanishes",
    }
    assert all(d.candidate is not None for d in found)


def test_added_effects_have_the_order_of_the_path():
    rungs = (model_fit(), model_fit([MASS]), model_fit([LAG, MASS]))
    found = selection.SelectionPath(rungs, {}, (), (), ())
    assert found.added == [MASS, LAG]


@pytest.mark.parametrize(
    ("law", "first"),
    [
        ({"extra-mass": 0.2, "presliding": 0.7}, "presliding"),
        ({"extra-mass": 0.6, "presliding": 0.7}, "presliding"),
        ({"extra-mass": 0.4, "presliding": 0.3}, "stribeck"),  # the named one is likelier than both
    ],
)
def test_the_most_probable_equivalent_is_selected(monkeypatch: pytest.MonkeyPatch, law: dict[str, float], first: str):
    """Heat transfer is likelier by far, and leaves twice as much."""
    named, *rivals = (candidate(n, 5000.0, before=BEFORE) for n in ("stribeck", *law))
    far = candidate("heat-transfer", 7900.0, before=BEFORE)
    likely = law | {"stribeck": 0.5, "heat-transfer": 0.99}
    monkeypatch.setattr(next_term, "log_odds_among_equivalents", lambda diagnosis_data, one: likely[one.effect.name])
    assert (
        next_term.most_probable_equivalent(diagnosis_data(held_out=False), Term(named, (*rivals, far))).effect.name
        == first
    )


@pytest.mark.parametrize("shown", [True, False])
def test_an_exclusive_measurement_may_raise_the_free_run_error(monkeypatch: pytest.MonkeyPatch, shown: bool):
    """Of 100 resting samples of an accelerometer, off by three times their noise, its bias leaves noise alone."""
    bias = "acceleration-bias"
    where = climbing(("", 9000.0, 10.0, 12.0), (bias, 5000.0, 10.1, 12.1))
    base, last = where.of(()), where.of((bias,))
    squares = {id(base): 900.0 if shown else 100.0, id(last): 100.0}
    monkeypatch.setattr(
        DiagnosisData, "exclusive_channel_costs", lambda self, model_fit, effect: [(squares[id(model_fit)], 100.0)]
    )
    tried = where.candidate(base, last, where.effects[bias])
    assert (next_term.next_term(where, [decision(tried)])[0] is tried) == shown
    assert (selection._reordered_path(where, base, last, [base, last])[0] == [base, last]) == shown
