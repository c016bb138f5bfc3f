"""Does each rule of the search earn its place? ``python -m benchmarks.ablation EXAM [CASE ...]``

Each case of an exam that ``pneucli exam`` wrote is diagnosed by the program as it is, and noted is which rules acted:
where one did, the case is diagnosed once more without it. Where it did not act the answer is the same, so what a
rule is worth is the difference over the cases in which it acted. A rule that costs nothing to leave out goes.
``RULES=name,name`` takes some of them.
"""

from __future__ import annotations

import importlib
import operator
import os
import random
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import wraps
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from pneucli.config import load
from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY
from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.decision import judge
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.score import FittedModel
from pneucli.exam.graded_case import GradedCase
from pneucli.exam.grading import graded_cases
from pneucli.physics.declaration import Effect
from pneucli.pipeline.context import Context
from pneucli.quantities import Z95
from pneucli.stages import diagnose, ingest

Watch = tuple[str, Callable[..., bool]]


@dataclass(frozen=True)
class Rule:
    """One rule: ``watch`` tells by a function's result and its arguments whether it acted, ``without`` leaves it out.

    Functions and constants are named by module and attribute below ``pneucli``; what takes a function's place is made
    from it.
    """

    what: str
    watch: Watch
    without: Mapping[str, Any]


def always(value: Any) -> Callable[[Any], Any]:
    """Return what makes of a function one that returns a value."""
    return lambda _: lambda *_, **__: value


def refusal(reason: str) -> Watch:
    return "diagnose.hypothesis_tests:_reason", lambda found, *_: found == reason


def acts(found: Any, *_: Any) -> bool:
    return bool(found)


def least(able: Sequence[Candidate]) -> Candidate:
    """Return the candidate with the lowest cost."""
    return min(able, key=lambda c: c.full.cost)


def added_effects(base: FittedModel, last: FittedModel) -> list[Effect]:
    return [e for e in last.model.effects if e.name not in base.effect_names]


def probable_steps(data: DiagnosisData, path: Sequence[FittedModel]) -> int:
    """Return how many steps of a path add a probable effect, up to the first that does not."""
    for i, (before, after) in enumerate(pairwise(path)):
        (effect,) = added_effects(before, after)
        if not judge(data, Term(data.candidate(before, after, effect), ())).decision.supported:
            return i
    return len(path) - 1


def up_to_improbable(forward: Callable[..., Any]) -> Callable[..., Any]:
    """Return a search that ends where it would add an improbable effect."""

    def ended(data: DiagnosisData, base: FittedModel) -> Any:
        path, rounds = forward(data, base)
        kept = probable_steps(data, path)
        return path[: kept + 1], rounds[: kept + 1]

    return ended


def drop_none(data: DiagnosisData, base: FittedModel, last: FittedModel) -> Any:
    """Return a model with the judgement of every added effect."""
    judged = {}
    for effect in added_effects(base, last):
        (reduced,) = data.refit_without(last, [effect])
        judged[effect.name] = judge(data, Term(data.candidate(reduced, last, effect), ()), constrained=True)
    return last, judged, []


def symmetric_interval(ratio: float, _: float, covariance: NDArray[np.float64]) -> tuple[float, float]:
    """Return the interval of a ratio from its own standard error."""
    half_width = Z95 * float(np.sqrt(covariance[0, 0]))
    return ratio - half_width, ratio + half_width


RULES = {
    # what a candidate must pass
    "family of tests": Rule("p values adjusted for the family", refusal("not-significant"),
                            {"diagnose.hypothesis_tests:holm_adjusted": lambda _: lambda p, _n: list(p)}),
    "chance": Rule("an effect must be significant", refusal("not-significant"),
                   {"diagnose.hypothesis_tests:holm_adjusted": lambda _: lambda p, _n: [0.0] * len(p)}),
    # hard constraints
    "at a bound": Rule("an effect at a bound is refused", refusal("at-bound"),
                       {"diagnose.constraints:end_locations":
                        lambda f: lambda t: [e for e in f(t) if e != "bound"]}),
    "below a sample": Rule("a time shorter than half a sample is not resolved", refusal("below-resolution"),
                           {"diagnose.constraints:below_resolution": always(False)}),
    "direct reading": Rule("samples at ambient refute an offset",
                           ("diagnose.constraints:refuted_by_reading", acts),
                           {"diagnose.constraints:refuted_by_reading": always(False)}),
    "unmeasured force": Rule("without p2 no effect is named that acts on the force alone",
                             ("diagnose.constraints:has_unmeasured_force", acts),
                             {"diagnose.constraints:has_unmeasured_force": always(False)}),
    "interval": Rule("an effect whose interval contains its absence is refused",
                     ("diagnose.constraints:interval_contains_null", acts),
                     {"diagnose.constraints:interval_contains_null": always(False)}),
    "product": Rule("the interval of a ratio is that of its product",
                    ("identify.estimation.fit:ratio_interval", lambda *_: True),
                    {"identify.estimation.fit:ratio_interval": lambda _: symmetric_interval}),
    "free-run error": Rule("the held-out free-run error must not rise",
                           ("diagnose.constraints:raises_held_out_error", acts),
                           {"diagnose.constraints:raises_held_out_error": always(False)}),
    "horizon": Rule("a time must not vary with the horizon",
                    ("diagnose.constraints:varies_with_horizon", acts),
                    {"diagnose.constraints:varies_with_horizon": always(False)}),
    # the search
    "fewest parameters": Rule("of equals the one with the fewest parameters is first",
                              ("diagnose.selection:best_candidate", lambda found, able: found is not least(able)),
                              {"diagnose.selection:best_candidate": lambda _: least}),
    "most probable": Rule("with an unmodelled effect the most probable one is first",
                          ("diagnose.selection:_most_probable", lambda found, _, able: found is not least(able)),
                          {"diagnose.selection:_most_probable": lambda _: lambda _d, able: least(able)}),
    "past improbable": Rule("with an unmodelled effect the search passes improbable ones",
                            ("diagnose.selection:_forward",
                             lambda found, data, _: probable_steps(data, found[0]) < len(found[0]) - 1),
                            {"diagnose.selection:_forward": up_to_improbable}),
    "probability": Rule("a more probably absent effect is not named",
                        ("diagnose.decision:probability", lambda found, *_: found < MIN_NAMED_PROBABILITY),
                        {"diagnose.decision:MIN_NAMED_PROBABILITY": lambda _: 0.0}),
    "dropped": Rule("improbable effects and those that violate a constraint are dropped",
                    ("diagnose.selection:_without_improbable", lambda found, *_: bool(found[2])),
                    {"diagnose.selection:_without_improbable": lambda _: drop_none}),
    "dropped again": Rule("what was dropped beside an impossible estimate is tried again without it",
                          ("diagnose.selection:_with_dropped_again", lambda found, _, last, _d: found is not last),
                          {"diagnose.selection:_with_dropped_again": lambda _: lambda _d, last, _e: last}),
    "both chambers": Rule("an effect of both chambers replaces the same at each",
                          ("diagnose.selection:_with_whole_effects", lambda found, _d, _b, last: found is not last),
                          {"diagnose.selection:_with_whole_effects": lambda _: lambda _d, _b, last: last}),
    "exclusive": Rule("an effect with channels of its own is judged by these",
                      ("diagnose.equivalence:Term.is_measured_exclusively", acts),
                      {"diagnose.equivalence:Term.is_measured_exclusively": always(False)}),
    # costs and fits
    "bounds": Rule("a set-valued law explains nothing within its bounds",
                   ("diagnose.score:coverage_weights", lambda found, *_: bool(np.any(found != 1.0))),
                   {"diagnose.score:coverage_weights": lambda f: lambda *a: np.ones_like(f(*a))}),
    "profile over time": Rule("a time is profiled over its whole range",
                              ("identify.estimation.model_fit:lower_profile_minimum",
                               lambda found, *_: found is not None),
                              {"identify.estimation.model_fit:lower_profile_minimum": always(None)}),
    "noise of the model": Rule("the cost excludes the noise of a correct model",
                               ("diagnose.score:correct_for_model_noise", lambda *_: True),
                               {"diagnose.score:correct_for_model_noise": lambda _: lambda _v, _d, residual: residual}),
    "flow": Rule("held-out recordings may have another flow gain",
                 ("diagnose.score:with_flow_gain_errors",
                  lambda found, *given: any(map(operator.is_not, found, given[-1]))),
                 {"diagnose.score:with_flow_gain_errors": lambda _: lambda _m, _v, _r, starts: list(starts)}),
    "starts": Rule("initial states may have errors",
                   ("identify.residuals.chambers:initial_state_sensitivity", lambda *_: True),
                   {"identify.residuals.chambers:initial_state_sensitivity": always({})}),
}  # fmt: skip


SMALL_RULES = ("chance", "probability")
COMPARED = ("verdict", "missing", "answer_set")  # of two answers to one case


def require_rules() -> None:
    """Raise AttributeError where a rule names a function or a constant that the program no longer has."""
    for rule in RULES.values():
        for name in (rule.watch[0], *rule.without):
            getattr(*place(name))


def place(name: str) -> tuple[Any, str]:
    """Return the module or class, and the attribute of it."""
    module, _, path = name.partition(":")
    owner: Any = importlib.import_module(f"pneucli.{module}")
    *classes, attribute = path.split(".")
    for one in classes:
        owner = getattr(owner, one)
    return owner, attribute


@contextmanager
def replaced(what: Mapping[str, Callable[[Any], Any]]) -> Iterator[None]:
    """Put other functions and constants in the place of some."""
    before = [(*place(name), getattr(*place(name))) for name in what]
    try:
        for (owner, attribute, original), make in zip(before, what.values(), strict=True):
            setattr(owner, attribute, make(original))
        yield
    finally:
        for owner, attribute, original in before:
            setattr(owner, attribute, original)


def watching(rules: Mapping[str, Rule], acted: set[str]) -> dict[str, Callable[[Any], Any]]:
    """Return functions that do what they did, and note which rules acted."""
    by_function: dict[str, list[tuple[str, Callable[..., bool]]]] = {}
    for name, rule in rules.items():
        by_function.setdefault(rule.watch[0], []).append((name, rule.watch[1]))

    def watched(original: Any, tells: Sequence[tuple[str, Callable[..., bool]]]) -> Any:
        @wraps(original)
        def noting(*args: Any, **more: Any) -> Any:
            found = original(*args, **more)
            acted.update(name for name, tell in tells if tell(found, *args))
            return found

        return noting

    return {name: lambda f, tells=tells: watched(f, tells) for name, tells in by_function.items()}


def answered(path: Path, folder: Path, answer: Mapping[str, Any]) -> tuple[dict[str, Any], float]:
    """Diagnose a case whose recordings were read into ``folder``; return the answer and its processor seconds."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as out:
        found = diagnose.run(Context(path, load(path), Path(out), folder, answers={"ingest": answer}))
    return found, time.process_time() - begun


def studied(case: Path, rules: Mapping[str, Rule]) -> dict[str, tuple[dict[str, Any], float]]:
    """Return the answers by rule left out; under "" that of the program as it is."""
    path = case / "pipeline.toml"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "ingest").mkdir()
        read = ingest.run(Context(path, load(path), folder / "ingest", folder))
        acted: set[str] = set()
        with replaced(watching(rules, acted)):
            out = {"": answered(path, folder, read)}
        for rule in (r for r in rules if r in acted):
            with replaced(rules[rule].without):
                out[rule] = answered(path, folder, read)
    return out


@dataclass
class Count:
    """What came of cases, or what a rule changed in them."""

    cases: int = 0
    changed: int = 0
    right: int = 0
    exact: int = 0
    wrong: int = 0
    accused: int = 0
    unflagged: int = 0
    seconds: float = 0.0
    known: int = 0

    def add(self, g: GradedCase, seconds: float, sign: int = 1) -> None:
        """Count one answer, or take it off."""
        self.cases += sign > 0
        self.known += sign * bool(g.hidden)
        self.right += sign * (bool(g.hidden) and g.hidden <= g.answer_set)
        self.exact += sign * (bool(g.hidden) and g.hidden == g.missing)
        self.wrong += sign * len(g.missing - g.hidden)
        self.accused += sign * (g.is_null and bool(g.missing))
        self.unflagged += sign * (bool(g.uncatalogued_effect) and g.verdict != "unexplained")
        self.seconds += sign * seconds


HEAD = "| {:20} | {:>5} | {:>7} | {:>5} | {:>5} | {:>11} | {:>13} | {:>15} | {:>7} | {}"


def shown(name: str, c: Count, what: str) -> str:
    return HEAD.format(name, c.cases, c.changed, f"{c.right:+d}", f"{c.exact:+d}", f"{c.wrong:+d}", f"{c.accused:+d}",
                       f"{c.unflagged:+d}", f"{c.seconds:+.0f}", what)  # fmt: skip


def judged(exam: Path, cases: Sequence[GradedCase], rules: Mapping[str, Rule]) -> tuple[Count, dict[str, Count]]:
    """Diagnose cases; return what came of them, and by rule what leaving it out changed. Ctrl-C ends with the last."""
    whole, without = Count(), {name: Count() for name in rules}
    with suppress(KeyboardInterrupt):
        for i, g in enumerate(cases, 1):
            found = studied(exam / g.case, rules)
            answer, seconds = found.pop("")
            as_it_is = GradedCase(g.case, g.truth, answer, None)
            whole.add(as_it_is, seconds)
            for name, (other, spent) in found.items():
                one, count = GradedCase(g.case, g.truth, other, None), without[name]
                count.changed += any(getattr(one, k) != getattr(as_it_is, k) for k in COMPARED)
                count.add(one, spent)
                count.add(as_it_is, seconds, -1)
            print(f"{i} of {len(cases)}: {g.case}", file=sys.stderr, flush=True)
    return whole, without


def main(arguments: Sequence[str]) -> None:
    """Diagnose the cases, each without every rule that acted in it, and print the table."""
    require_rules()
    if small.SMALL in arguments:
        with tempfile.TemporaryDirectory() as folder:
            table(small.exam(Path(folder)), (), SMALL_RULES)
    else:
        os.environ["PNEUCLI_THREADS"] = "1"
        table(Path(arguments[0]), arguments[1:], os.environ.get("RULES", ",".join(RULES)).split(","))


def table(exam: Path, only: Sequence[str], names: Sequence[str]) -> None:
    """Print what each rule of these names is worth on the cases of an exam."""
    rules = {name: RULES[name] for name in names}
    cases = [g for g in graded_cases(exam, exam / "answers") if not only or g.case in only]
    random.Random(0).shuffle(cases)  # so that the first are as good as any
    whole, without = judged(exam, cases, rules)
    print(HEAD.format("without", "acted", "changed", "right", "exact", "wrong names", "nulls accused",
                      "unknown missed", "seconds", "the rule |"))  # fmt: skip
    print(shown("(all rules)", whole, f"of {whole.known} with effects |"))
    for name, count in without.items():
        print(shown(name, count, f"{rules[name].what} |"))


if __name__ == "__main__":
    main(sys.argv[1:])
