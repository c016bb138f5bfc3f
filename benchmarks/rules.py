"""Which rules of the diagnosis earn their place? ``python -m benchmarks.rules [WORLD...] [--exam FOLDER]...``.

Every case is diagnosed once while each rule is watched: it speaks where a decision differs from the same one without
it. Then the cases in which a rule spoke are diagnosed again without it (a rule that never spoke changes nothing), and
the names of both are judged by what is true. A rule whose removal makes nothing worse is one too many.

    python -m benchmarks.rules --exam FOLDER    the cases of an exam as well, that "pneucli exam" wrote (repeatable)
    python -m benchmarks.rules --rule NAME      of the rules this one alone (repeatable)
    python -m benchmarks.rules --count          only where each speaks: diagnose nothing again

Answers are kept below ``build/rules`` by the digest of the program. The exams of docs/development/experiments.md are
``pneucli exam FOLDER --cases C --nulls N --seed 8810##`` with these seeds, counts and conditions: 01 14+6 usual; 02 8+3
usual ``--size 0.3333``; 03 10+4 messy; 04 14+4 wide; 05 5+2 rate-200Hz; 06 4+2 imposed+messy; 07 5+2 two-valves; 08 6+2
both-sides; 09 4+1 hose; 10 3+0 no-p2, constant-speed, hanging-load, return-spring.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.cases import ROOT, Case, judged, source_digest, truth_of, truths, worlds
from benchmarks.score import KEPT as KEPT_SCORE
from benchmarks.score import digest_of_inputs, essence

KEPT = ROOT / "build" / "rules"
WORLDS = ("fixtures", "cases", "rigs-plc", "rigs-bench", "rigs-seal", "rigs-process", "thesis-cases")
LOG, WITHOUT = "PNEUCLI_RULES_LOG", "PNEUCLI_WITHOUT_RULE"  # of the process that diagnoses
Function = Callable[..., Any]
Replaced = Callable[[Function], Function]
TESTS = ("selection._reason", "constraints.violated_constraint")  # what every estimate has to pass


@dataclass(frozen=True)
class Rule:
    """A rule and how it is left out: ``without`` replaces the ``function`` of ``pneucli.diagnose``.

    ``decisions`` are the functions whose results it decides on, by default that one. ``speaks`` tells by a result and
    the arguments whether it spoke; by default the decision is made again without the rule.
    """

    function: str
    without: Replaced
    decisions: tuple[str, ...] = ()
    speaks: Callable[..., bool] | None = None


def gives(value: object) -> Replaced:
    """Replace a function by one that gives a value."""
    return lambda _: lambda *_args, **_named: value


def gives_argument(index: int) -> Replaced:
    """Replace a function by one that gives one of its arguments."""
    return lambda _: lambda *args, **_named: args[index]


def with_constant(name: str, value: float) -> Replaced:
    """Replace a function by the same one with another value of a constant of its module."""

    def replaced(function: Function) -> Function:
        names = function.__globals__

        def other(*args: Any, **named: Any) -> Any:
            before, names[name] = names[name], value
            try:
                return function(*args, **named)
            finally:
                names[name] = before

        return other

    return replaced


def without_violation(reason: str) -> Replaced:
    """Replace what yields constraints by the same with one of them never violated."""
    return lambda function: lambda *a, **n: ((fails and found != reason, found) for fails, found in function(*a, **n))


def lowest_cost(_: Function) -> Function:
    """Replace the choice among candidates by that of the lowest cost."""
    return lambda candidates: min(candidates, key=lambda c: c.full.cost)


def of_best_fit(_: Function) -> Function:
    """Replace the choice of the most probable candidate by that of the best fit."""
    return lambda _data, candidates: function_of("equivalence.best_candidate")(candidates)


def of_last_model(_: Function) -> Function:
    """Replace the intervals over models by those of the last one."""
    return lambda data, path: data.with_intervals(path.last)


def added_effects(base: Any, last: Any) -> list[Any]:
    """Return the effects of a fitted model that another one lacks."""
    return [e for e in last.model.effects if e.name not in base.effect_names]


def probable_steps(data: Any, path: Sequence[Any]) -> int:
    """Return how many steps of a path add a probable effect, up to the first that does not."""
    judge, term = function_of("decision.judge"), function_of("equivalence.Term")
    for i, (before, after) in enumerate(pairwise(path)):
        (effect,) = added_effects(before, after)
        if not judge(data, term(data.candidate(before, after, effect), ())).decision.supported:
            return i
    return len(path) - 1


def up_to_improbable(forward: Function) -> Function:
    """Replace the search by one that ends where it would add an improbable effect."""

    def ended(data: Any, base: Any) -> Any:
        path, rounds, unpromising = forward(data, base)
        kept = probable_steps(data, path)
        return path[: kept + 1], rounds[: kept + 1], unpromising if kept == len(path) - 1 else []

    return ended


def drop_none(_: Function) -> Function:
    """Replace the dropping of effects by judgements of all."""

    def kept(data: Any, path: Sequence[Any]) -> Any:
        judge, term, found, last = function_of("decision.judge"), function_of("equivalence.Term"), {}, path[-1]
        for effect in added_effects(path[0], last):
            (reduced,) = data.refit_without(last, [effect])
            found[effect.name] = judge(data, term(data.candidate(reduced, last, effect), ()), constrained=True)
        return last, found, []

    return kept


OF_ESTIMATE = ("vanishes", "replaces-base-parameter", "at-bound", "below-resolution", "contradicted-by-reading")
OF_MODEL = ("cannot-show", "interval-contains-null", "not-significant", "raises-error")
RULES: Mapping[str, Rule] = {
    **{one: Rule("constraints.violations_of_estimate", without_violation(one), TESTS) for one in OF_ESTIMATE},
    **{one: Rule("constraints._violations", without_violation(one), TESTS[1:]) for one in OF_MODEL},
    "significance": Rule("selection._reason", with_constant("ALPHA", 2.0)),
    "family of tests": Rule("selection.holm_adjusted", lambda _: lambda p, _n: list(p), ("selection.apply_tests",)),
    "free-run error": Rule(
        "constraints._errors_of_step",
        gives((1.0, 1.0, 1.0)),
        ("constraints.violated_constraint", "selection._without_rise"),
    ),
    "collinear and needless": Rule("evidence.replaced_base_parameters", with_constant("MIN_COLLINEARITY", 2.0)),
    "alike": Rule("evidence._are_alike", gives(False), ("evidence.replaced_base_parameters",)),
    "probability": Rule("decision.judge", with_constant("MIN_NAMED_PROBABILITY", 0.0)),
    "past improbable": Rule(
        "selection._forward",
        up_to_improbable,
        speaks=lambda found, data, _: probable_steps(data, found[0]) < len(found[0]) - 1,
    ),
    "promising": Rule(
        "selection._forward", with_constant("MIN_PROMISING", 0.0), speaks=lambda found, *_: bool(found[2])
    ),
    "dropped": Rule("selection._without_improbable", drop_none, speaks=lambda found, *_: bool(found[2])),
    "fewest parameters": Rule("equivalence.best_candidate", lowest_cost),
    "sensor fault last": Rule("equivalence._is_sensor_fault", gives(False), ("equivalence.best_candidate",)),
    "probable before cheap": Rule("selection._most_probable", of_best_fit),
    "no rise beyond noise": Rule("selection._without_rise", gives_argument(1)),
    "screen by gain": Rule("selection.score_test_screen", with_constant("MAX_BY_GAIN", 0)),
    "screen by share": Rule("selection.score_test_screen", with_constant("MIN_RELATIVE_SHARE", 0.0)),
    "screen by chi-square": Rule("selection.score_test_screen", with_constant("MIN_CHI2", 0.0)),
    "intervals over models": Rule("diagnosis._fit_over_models", of_last_model),
    "shape of the residual": Rule("adequacy._has_shape", gives(False), ("adequacy.significant_lack_of_fit",)),
    "untrimmed residual": Rule("adequacy._exceeds", with_constant("UNTRIMMED_FACTOR", 1e9)),
    "undetectable effects": Rule("diagnosis._verdict", with_constant("MAX_UNDETECTABLE_SHARE", 2.0)),
}


def function_of(name: str) -> Function:
    """Return a function of the diagnosis by the names of its module and itself, as it stands there now."""
    module, _, function = name.partition(".")
    found: Function = getattr(import_module(f"pneucli.diagnose.{module}"), function)
    return found


@contextmanager
def put(places: Mapping[str, Function]) -> Iterator[None]:
    """Put functions in the place of others, by their names, wherever the program knows them."""
    modules = [vars(one) for name, one in list(sys.modules.items()) if name.startswith("pneucli.")]
    before = []
    for name, other in places.items():
        function = function_of(name)
        found = [(names, key) for names in modules for key, value in list(names.items()) if value is function]
        before += [(names, key, function) for names, key in found]
        for names, key in found:
            names[key] = other
    try:
        yield
    finally:
        for names, key, function in before:
            names[key] = function


def left_out(name: str) -> contextlib.AbstractContextManager[None]:
    """Leave a rule out."""
    rule = RULES[name]
    return put({rule.function: rule.without(function_of(rule.function))})


@contextmanager
def watched(rules: Sequence[str] = tuple(RULES)) -> Iterator[set[str]]:
    """Note which rules speak."""
    spoke, busy = set[str](), False

    def asks_again(decision: str, function: Function) -> Function:
        mine = [name for name in rules if decision in (RULES[name].decisions or (RULES[name].function,))]

        def asking(*args: Any, **named: Any) -> Any:
            nonlocal busy
            found = function(*args, **named)
            if not busy:
                busy = True
                try:
                    spoke.update(
                        n for n in mine if n not in spoke and _speaks(n, decision, function, found, args, named)
                    )
                finally:
                    busy = False
            return found

        return asking

    decisions = sorted({d for name in rules for d in RULES[name].decisions or (RULES[name].function,)})
    with put({one: asks_again(one, function_of(one)) for one in decisions}):
        yield spoke


def _speaks(name: str, decision: str, function: Function, found: Any, args: Any, named: Any) -> bool:
    """Return whether a decision would be another one without a rule."""
    rule = RULES[name]
    if rule.speaks is not None:
        return rule.speaks(found, *args)
    if rule.function == decision:
        return not _is_same(found, rule.without(function)(*args, **named))
    with left_out(name):
        return not _is_same(found, function(*args, **named))


def _is_same(found: object, other: object) -> bool:
    """Return whether two results decide alike: both pass or fail a test, or are equal."""
    if isinstance(found, str | None) and isinstance(other, str | None):
        return (found in (None, "supported")) == (other in (None, "supported"))
    with contextlib.suppress(ValueError):  # of arrays
        return found is other or bool(found == other)
    return False


def diagnose_watched(words: Sequence[str]) -> int:
    """Run the program with every rule watched, or with one left out, as the environment says."""
    program = import_module("pneucli.cli")
    import_module("pneucli.stages.diagnose")
    sys.argv = ["pneucli", *words]
    try:
        if without := os.environ.get(WITHOUT):
            with left_out(without):
                program.main()
        else:
            with watched() as spoke:
                program.main()
    except SystemExit as end:
        if not without:
            Path(os.environ[LOG]).write_text(json.dumps(sorted(spoke)), encoding="utf-8")
        return int(end.code or 0)
    return 0


def ask(case: Case, without: str, kept: Path) -> dict[str, Any]:
    """Return the row of a diagnosis without a rule ("": with all), as the score keeps it, and the rules that spoke."""
    path = kept / case.world / case.name / f"{without or 'all'}.json"
    inputs = f"{digest_of_inputs(case)} {len(RULES)}"
    if path.is_file():
        row: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if row["inputs"] == inputs:
            return row
    with tempfile.TemporaryDirectory() as name:
        log = Path(name) / "spoke.json"
        environment = {
            **os.environ,
            **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "PNEUCLI_THREADS"), "1"),
            WITHOUT: without,
            LOG: str(log),
        }
        asked = [str(case.pipeline), "--out", str(Path(name) / "out"), "--json", "--quiet"]
        words = [sys.executable, "-m", "benchmarks.rules", "diagnose", *asked]
        done = subprocess.run(words, check=False, env=environment, cwd=ROOT, capture_output=True, text=True)
        spoke = json.loads(log.read_text(encoding="utf-8")) if log.is_file() else []
    row = {"exit": done.returncode, "spoke": spoke, "inputs": inputs, **essence("diagnose", done.stdout)}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(row), encoding="utf-8")
    return row


def change(case: Case, row: Mapping[str, Any], without: Mapping[str, Any]) -> str:
    """Return what a rule does to the names of a case: "worse" or "better" without it, "other", "" the same."""
    if without["exit"] not in (0, 1) or row["exit"] not in (0, 1):
        return "" if without["exit"] == row["exit"] else "other"
    before, after = judged(case.truth, row), judged(case.truth, without)
    gain = [after.found - before.found, before.false - after.false, after.exact - before.exact]
    if any(g < 0 for g in gain):
        return "worse"
    if any(gain):
        return "better"
    same = (row["missing"], row["verdict"]) == (without["missing"], without["verdict"])
    return "" if same else "other"


def cases_of(chosen: Sequence[str], exams: Sequence[Path]) -> list[Case]:
    """Return the cases with truth of the worlds at hand, and of some exams."""
    found = [
        case
        for world in worlds(sys.executable, KEPT_SCORE, full=True)
        if world.name in (chosen or WORLDS)
        for case in world.cases()
    ]
    exam = [
        Case(f"exam-{folder.name}", path.name, (), truth_of(written), path / "pipeline.toml")
        for folder in exams
        for path, written in truths(folder)
    ]
    return [case for case in [*found, *exam] if case.pipeline is not None and case.truth.names_known]


def table(results: Mapping[str, Mapping[str, list[str]]], count: int) -> Iterator[str]:
    """Yield the lines of the table: a rule each, with the cases in which it spoke and what its removal does to them."""
    yield f"{count} cases"
    yield "| rule | speaks in | without it worse | better | other |"
    yield "| --- | ---: | --- | --- | --- |"
    for name, by_change in results.items():
        cells = [", ".join(by_change.get(kind, [])) or "-" for kind in ("worse", "better", "other")]
        yield f"| {name} | {sum(map(len, by_change.values()))} | {' | '.join(cells)} |"


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rules")
    parser.add_argument("worlds", nargs="*", help=f"worlds, default {', '.join(WORLDS)}")
    parser.add_argument("--exam", type=Path, action="append", default=[], help="a folder of pneucli exam")
    parser.add_argument("--rule", action="append", choices=list(RULES), help="this rule alone")
    parser.add_argument("--count", action="store_true", help="diagnose nothing without rules")
    parser.add_argument("--jobs", type=int, default=2, help="cases at once")
    parser.add_argument("--kept", type=Path, default=KEPT, help="where answers are kept")
    parser.add_argument("--small", action="store_true", help="one fixture and one rule")
    return parser.parse_args(list(arguments))


def main(arguments: Sequence[str]) -> int:
    """Ask, compare, print."""
    if arguments[:1] == ["diagnose"]:
        return diagnose_watched(arguments)
    asked = parsed(arguments)
    cases = cases_of(["fixtures"], [])[:1] if asked.small else cases_of(asked.worlds, asked.exam)
    rules = ["dropped"] if asked.small else asked.rule or list(RULES)
    kept = asked.kept / source_digest(ROOT / "pneucli")
    results: dict[str, dict[str, list[str]]] = {name: {} for name in rules}
    with ThreadPoolExecutor(asked.jobs) as pool:
        rows = list(pool.map(lambda case: ask(case, "", kept), cases))
        pairs = [
            (name, case, row) for case, row in zip(cases, rows, strict=True) for name in rules if name in row["spoke"]
        ]
        again = pool.map(lambda one: {} if asked.count else ask(one[1], one[0], kept), pairs)
        for (name, case, row), without in zip(pairs, again, strict=True):
            kind = "spoke" if asked.count else change(case, row, without)
            results[name].setdefault(kind, []).append(f"{case.world}/{case.name}")
    print("\n".join(table(results, len(cases))))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
