"""What an exam draws and hands over, as stored: the rig, recordings and pipeline file of each condition and effect."""

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.exam.cases import case_truth, prepare_case
from pneucli.exam.conditions import CONDITIONS, parse
from pneucli.exam.hidden_effects import ALL_BY_NAME
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.parameters import Parameters
from tests.stored import hold_against

STORED = Path(__file__).parent / "stored"
SEED, SEEDS = 5, 200
MAX_RUNS = 12  # of one value in a command; of more, its sums are told
EXACT = 1e-4  # of the texts, which have six digits
NUMBERS = {"bore-#mm": 6, "supply-#bar": 3, "rate-#Hz": 200, "bits-#": 12}
NAMES = [one.pattern.replace("#", str(NUMBERS.get(one.pattern))) for one in CONDITIONS]
DIFFERENT = ("5/3+ends", "ends+return-spring", "5/3+switching", "wall-heat+free-b+two-valves", "no-p2+no-acceleration")
HIDDEN: dict[str, tuple[str, str, tuple[str, ...], str]] = {
    "leaks": ("axis", "usual", ("chamber-leak", "piston-leak", "dead-volume"), ""),
    "leaks of a vessel": ("valve", "usual", ("chamber-leak", "laminar-leak", "opening-leak"), ""),
    "hose of a side": ("axis", "both-sides+5/3", ("line-delay:2",), ""),
    "dead band": ("axis", "usual", ("valve-deadband",), ""),
    "droop": ("axis", "usual", ("supply-droop",), ""),
    "stribeck": ("axis", "usual", ("stribeck",), ""),
    "pump": ("valve", "stated-pump", ("pump-flow",), ""),
    "stranger": ("axis", "usual", (), "resonance of a flexibly coupled load"),
}


def value(one: object) -> str:
    """One number, or several of an array: runs of equal ones, or what tells a course."""
    if not isinstance(one, np.ndarray):
        return f"{one:.6g}" if isinstance(one, float) else str(one)
    runs = [(key, len(list(some))) for key, some in groupby(one.ravel().tolist())]
    if len(runs) <= MAX_RUNS:
        return " ".join(f"{level:.6g} x {count}" for level, count in runs)
    sums = (one.mean(), one.std(), np.mean(one * np.linspace(0.0, 1.0, one.size)), np.abs(np.diff(one)).sum())
    told = (one.size, one.flat[0], one.flat[-1], one.min(), one.max(), *sums)
    return " ".join(f"{round(float(number), 12) + 0.0:.6g}" for number in told)  # sums of what cancels are rounded to 0


def differing(one: Parameters, other: Parameters) -> Iterator[str]:
    for name, now in one._asdict().items():
        if now != getattr(other, name):
            yield f"{name} = {value(now)}"


def recording(plan: RecordingPlan, laboratory: Laboratory) -> Iterator[str]:
    yield f"-- {plan.name}, {plan.experiment}, {plan.use}, chamber {plan.chamber}"
    yield "; ".join(f"{name} = {value(one)}" for name, one in vars(plan.excitation).items())
    yield f"signals: {' '.join(laboratory.signals(plan))}"


def told(kind: str, condition: str, hidden: Sequence[str] = (), outside: str = "") -> list[str]:
    """Everything of a case that is not recorded."""
    conditions = parse(condition)
    case = prepare_case("case", kind, hidden, outside, 1.0, SEED, conditions)
    laboratory = case.laboratory
    truth = case_truth(laboratory, [ALL_BY_NAME[name] for name in hidden], outside, conditions)
    lines = [f"== rig: {kind}", *differing(laboratory.parameters, Parameters())]
    for chamber in (1, 2):
        bench = laboratory.valve_test_rig(chamber)
        lines += [f"== bench of chamber {chamber}", *differing(bench, laboratory.parameters)]
    lines += ["== sensors", *(f"{name} = {value(one)}" for name, one in vars(laboratory.sensors).items())]
    lines += ["== recordings", *(line for plan in case.plans for line in recording(plan, laboratory))]
    lines += ["== pipeline file", *laboratory.pipeline(case.plans, "raw").splitlines()]
    lines += ["== truth", *(f"{name}: {one}" for name, one in (truth | {"mess": case.small_effects}).items())]
    return [*lines, f"kinds: {' '.join(conditions.kinds)}", f"excluded: {' '.join(sorted(conditions.excluded))}"]


def changes(lines: Sequence[str], usual: Sequence[str]) -> Iterator[str]:
    """The lines that differ, each below the heading of its part."""
    known, title, is_told = set(usual), "", False
    for line in lines:
        if line.startswith(("==", "--")):
            title, is_told = line, False
        elif line not in known or title not in known:
            yield from (line,) if is_told else (title, line)
            is_told = True


@pytest.mark.parametrize("kind", ["valve", "friction", "axis"])
def test_the_usual_case_is_as_stored(kind: str) -> None:
    hold_against(STORED / f"usual {kind}.txt", "\n".join(told(kind, "usual")) + "\n", EXACT)


def test_every_condition_changes_what_is_stored() -> None:
    usual = {kind: told(kind, "usual") for kind in ("valve", "friction", "axis")}
    lines = []
    for name in (*NAMES[1:], *DIFFERENT):
        for kind in dict.fromkeys((parse(name).kinds[0], parse(name).kinds[-1])):
            lines += [f"==== {name}: {kind}", *changes(told(kind, name), usual[kind])]
    hold_against(STORED / "conditions.txt", "\n".join(lines) + "\n", EXACT)


def test_every_hidden_effect_changes_what_is_stored() -> None:
    lines = []
    for name, (kind, condition, hidden, outside) in HIDDEN.items():
        lines += [f"==== {name}", *changes(told(kind, condition, hidden, outside), told(kind, condition))]
    for name, effect in ALL_BY_NAME.items():
        lines += [f"==== {name}: {' '.join(effect.kinds)}; {effect.part} {effect.variable} {effect.under}"]
        for seed, size in enumerate((1.0, 1.0, 1.0, 1 / 3)):
            rig = effect.apply(Parameters(static=20.0 * (seed == 2)), size, np.random.default_rng(seed))
            lines += ["; ".join(differing(rig, Parameters())), value(np.array([*effect.true_parameters(rig).values()]))]
    hold_against(STORED / "hidden effects.txt", "\n".join(lines) + "\n", EXACT)


@pytest.mark.parametrize("kind", ["valve", "friction", "axis"])
def test_what_is_drawn_of_rigs_and_laboratories_is_as_stored(kind: str) -> None:
    """Of each quantity the least and the largest of many, and how many differ; of a few values how often each comes."""
    drawn: dict[str, list[Any]] = {}
    for seed in range(SEEDS):
        laboratory = prepare_case(
            "case", kind, (), "", 1.0, seed, parse("ends+5/3" if kind == "axis" else "usual")
        ).laboratory
        rig = laboratory.parameters
        about = vars(laboratory) | vars(laboratory.sensors) | rig._asdict()
        about |= {"rod": rig.piston_area_2 / rig.piston_area_1, "hums": laboratory.sensors.hum > 0.0}
        for name, one in about.items():
            drawn.setdefault(name, []).append(one)
    lines = []
    for name in sorted(drawn.keys() - {"parameters", "sensors"}):
        counts = {one: drawn[name].count(one) for one in dict.fromkeys(drawn[name])}
        numbers = [one for one in counts if one is not None]
        if len(counts) > 4:
            lines.append(f"{name}: {len(counts)} from {min(numbers):.6g} to {max(numbers):.6g}")
        elif len(counts) > 1:
            lines.append(f"{name}: {counts}")
    hold_against(STORED / f"drawn {kind}.txt", "\n".join(lines) + "\n", EXACT)
