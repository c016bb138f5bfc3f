"""The rules of the selection: what tells that one acted, and what the program does without it."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from itertools import pairwise
from typing import Any

from pneucli.diagnose.calibration import MIN_NAMED_PROBABILITY
from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.decision import judge
from pneucli.diagnose.equivalence import Term
from pneucli.diagnose.score import FittedModel
from pneucli.physics.declaration import Effect

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


def drop_none(data: DiagnosisData, path: Sequence[FittedModel], last: FittedModel) -> Any:
    """Return a model with the judgement of every added effect."""
    judged = {}
    for effect in added_effects(path[0], last):
        (reduced,) = data.refit_without(last, [effect])
        judged[effect.name] = judge(data, Term(data.candidate(reduced, last, effect), ()), constrained=True)
    return last, judged, []


RULES = {
    "family of tests": Rule("p values adjusted for the family", refusal("not-significant"),
                            {"diagnose.hypothesis_tests:holm_adjusted": lambda _: lambda p, _n: list(p)}),
    "chance": Rule("an effect must be significant", refusal("not-significant"),
                   {"diagnose.hypothesis_tests:holm_adjusted": lambda _: lambda p, _n: [0.0] * len(p)}),
    "at a bound": Rule("an effect at a bound is refused", refusal("at-bound"),
                       {"diagnose.constraints:end_locations":
                        lambda f: lambda t: [e for e in f(t) if e != "bound"]}),
    "interval": Rule("an effect whose interval contains its absence is refused",
                     ("diagnose.constraints:interval_contains_null", acts),
                     {"diagnose.constraints:interval_contains_null": always(False)}),
    "free-run error": Rule("the held-out free-run error must not rise",
                           ("diagnose.constraints:raises_held_out_error", acts),
                           {"diagnose.constraints:raises_held_out_error": always(False),
                            "diagnose.selection:raises_error_beyond_noise": always(False)}),
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
}  # fmt: skip


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
