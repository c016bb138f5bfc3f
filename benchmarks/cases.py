"""The worlds of ``benchmarks.score``: their cases, the commands asked of each, what is true of it, and how an answer of
``diagnose`` counts against that.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

DESCRIBED = Path(__file__).parent / "scores" / "truths.toml"
SEALED = ".sealed"
CLOSE = 0.15  # of the true value
CATALOGUE_NAMES = {"rod-seal-leak": "chamber-leak:2"}  # of effects that an author counts as unknown
SMALL_EFFECTS = "several small ones"  # outside the catalogue, and no disturbance that is to be flagged
READING_TOLERANCE = 0.02  # of the range of a signal that is read rightly
NOISE_FACTOR = 1.5  # by which an estimated noise may differ from the true one
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Truth:
    """What is true of a case.

    ``parameters``: the true values of the hidden effects, by effect and parameter, in the units of the catalogue; a
    pair is the interval that is right. ``unknown``: a disturbance outside the catalogue acts. ``mild``: the effects of
    which a healthy rig has a little, ``absent``: those that no recording can show. ``reads``: least and most of a
    signal (SI), ``noise``: its rms (SI), ``rate``: Hz, ``samples``: of all recordings, ``error``: the largest error
    over noise that a right reading leaves. ``may_refuse``: a refusal is right as well; ``doubts``: one of these checks
    is right as well.
    """

    hidden: frozenset[str] = frozenset()
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    unknown: bool = False
    mild: frozenset[str] = frozenset()
    absent: frozenset[str] = frozenset()
    names_known: bool = True
    reads: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    rate: Mapping[str, float] = field(default_factory=dict)
    samples: int | None = None
    error: float | None = None
    may_refuse: bool = False
    doubts: frozenset[str] = frozenset()

    @property
    def is_healthy(self) -> bool:
        """Whether nothing is to be named and nothing is to be flagged."""
        return self.names_known and not self.hidden and not self.unknown

    @property
    def is_about_reading(self) -> bool:
        """Whether it says how the raw files are to be read."""
        said = (self.reads, self.noise, self.rate, self.samples, self.error, self.may_refuse, self.doubts)
        return any(said)


def catalogue_name(name: str) -> str:
    """Return the name that the catalogue has for an effect."""
    return CATALOGUE_NAMES.get(name, name)


def mild_names(truth: Row) -> frozenset[str]:
    """Return the effects of which a healthy rig has a little as well."""
    listed = truth.get("background", [])
    return frozenset(truth.get("present_small", {})) | frozenset(listed if isinstance(listed, list) else [])


def truth_of(written: Row) -> Truth:
    """Return the truth that an exam, a rig by other hands or a shared case has written.

    An exam and a shared case write the hidden effects with their parameters, a rig their names and, apart, the
    parameters or the intervals that are right.
    """
    unknown = written.get("unknown", written.get("outside_the_catalogue")) or []
    others = [unknown] if isinstance(unknown, str) else list(unknown)
    hidden = written["hidden"]
    parameters = hidden if isinstance(hidden, dict) else written.get("parameters", {})
    return Truth(
        hidden=frozenset(map(catalogue_name, [*hidden, *(name for name in others if name in CATALOGUE_NAMES)])),
        parameters={catalogue_name(name): values for name, values in parameters.items()},
        unknown=any(name not in CATALOGUE_NAMES and name != SMALL_EFFECTS for name in others),
        mild=mild_names(written),
    )


def truths(folder: Path) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the folder of each case and what was written of it: sealed in an exam, beside the pipeline of a rig."""
    for path in sorted(folder.glob("*/truth.json")):
        yield path.parent, json.loads(path.read_text(encoding="utf-8"))
    for path in sorted((folder / SEALED).glob("case-*.json")):
        yield folder / path.stem, json.loads(path.read_text(encoding="utf-8"))


def described(world: str) -> dict[str, dict[str, Any]]:
    """Return by case what ``scores/truths.toml`` says of a world (see its first lines)."""
    worlds: dict[str, dict[str, Any]] = tomllib.loads(DESCRIBED.read_text(encoding="utf-8"))
    return worlds.get(world, {})


def described_truth(one: Row) -> Truth:
    """Return the truth that ``scores/truths.toml`` describes."""
    hidden = one.get("hidden")
    return Truth(
        hidden=frozenset(hidden or {}),
        parameters=hidden or {},
        names_known=hidden is not None,
        reads={name: (low, high) for name, (low, high) in one.get("reads", {}).items()},
        mild=frozenset(one.get("mild", [])),
        absent=frozenset(one.get("absent", [])),
        noise=one.get("noise", {}),
        rate=one.get("rate", {}),
        samples=one.get("samples"),
        error=one.get("error"),
        may_refuse=one.get("may_refuse", False),
        doubts=frozenset(one.get("doubts", [])),
    )


@dataclass
class Counts:
    """Counts of one answer of ``diagnose``, or of several added up.

    ``known``: cases of which the effects are known. ``found``: hidden effects in the answer, named or
    indistinguishable from a named one. ``right``: all of them are, and nothing is named where nothing is hidden.
    ``exact``: exactly the hidden effects are named. ``false``, ``mild``: names that are not hidden. ``close``,
    ``covered``: parameters within 15 %, intervals that hold the truth.
    """

    cases: int = 0
    answered: int = 0
    known: int = 0
    effects: int = 0
    found: int = 0
    right: int = 0
    exact: int = 0
    false: int = 0
    mild: int = 0
    healthy: int = 0
    silent: int = 0
    parameters: int = 0
    close: int = 0
    covered: int = 0
    refused: int = 0
    faults: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)})


def is_refused(row: Row) -> bool:
    """Whether the program gave no answer for the sake of its input: exit code 2, or checks that forbid an answer."""
    return row["exit"] == 2 or bool(row.get("refused"))


def is_fault(row: Row) -> bool:
    """Whether the program failed: neither done, nor a failed check, nor a fault of the input."""
    return row["exit"] not in (0, 1, 2)


def judged(truth: Truth, row: Row) -> Counts:
    """Return the counts of one answer of ``diagnose``, as the score keeps it."""
    out = Counts(cases=1, refused=int(is_refused(row)), faults=int(is_fault(row)))
    out.answered = int(not out.refused and not out.faults)
    if not truth.names_known:
        out.false = sum(name in truth.absent for name in row.get("missing", []))
        return out
    out.known, out.effects, out.healthy = 1, len(truth.hidden), int(truth.is_healthy)
    if not out.answered:
        return out
    classes = {name: {name, *row.get("twins", {}).get(name, [])} for name in row["missing"]}
    wrong = [name for name, equal in classes.items() if not equal & truth.hidden]
    out.found = len(truth.hidden & {name for equal in classes.values() for name in equal})
    out.mild = sum(name in truth.mild for name in wrong)
    out.false = len(wrong) - out.mild
    out.right = int(out.found == out.effects and (bool(truth.hidden) or not out.false))
    out.exact, out.silent = int(set(row["missing"]) == truth.hidden), int(truth.is_healthy and not wrong)
    for effect in truth.hidden & set(row["missing"]):
        for name, true in truth.parameters.get(effect, {}).items():
            if found := row["parameters"].get(f"{effect}.{name}"):
                value, low, high = found
                least, most = true if isinstance(true, list) else (true - CLOSE * abs(true), true + CLOSE * abs(true))
                inner = true if isinstance(true, list) else (true, true)
                out.parameters += 1
                out.close += least <= value <= most
                out.covered += low <= inner[1] and inner[0] <= high
    return out


def reading_faults(truth: Truth, rows: Mapping[str, Row]) -> list[str]:
    """Return what is wrong with how a case was read (rows by command), in words; nothing where it is right.

    A refusal and a doubt are right where the truth says so.
    """
    refused = [name for name in ("init", "ingest") if name in rows and rows[name]["exit"] == 2]
    if refused:
        return [] if truth.may_refuse else [f"{refused[0]} refuses"]
    read = rows.get("ingest", {})
    if truth.doubts & set(read.get("doubts", {})):
        return []
    wrong = []
    for signal, (least, most) in truth.reads.items():
        low, high = read.get("reads", {}).get(signal, (None, None))
        allowed = READING_TOLERANCE * (most - least)
        if low is None or abs(low - least) > allowed or abs(high - most) > allowed:
            wrong.append(f"{signal} {low} to {high}, true {least:g} to {most:g}")
    for signal, true in truth.noise.items():
        found = read.get("noise", {}).get(signal)
        if found is None or not true / NOISE_FACTOR <= found <= true * NOISE_FACTOR:
            wrong.append(f"noise of {signal} {found}, true {true:g}")
    for signal, true in truth.rate.items():
        found = read.get("rate", {}).get(signal)
        if found is None or abs(found - true) > READING_TOLERANCE * true:
            wrong.append(f"rate of {signal} {found} Hz, true {true:g}")
    if truth.samples is not None and read.get("samples") != truth.samples:
        wrong.append(f"{read.get('samples')} samples, true {truth.samples}")
    if truth.error is not None:
        errors = [one for one in rows.get("compare", {}).get("error", []) if one is not None]
        if not errors or errors[-1] > truth.error:
            wrong.append(f"error {errors[-1] if errors else None}, at most {truth.error:g} if read rightly")
    return wrong


ROOT = Path(__file__).parents[1]
AXIS = ("ingest", "identify", "compare", "diagnose")
DOOR = ("init", "ingest", "compare", "diagnose")
READ = ("ingest",)
REST = ("design", "simulate", "plan", "export", "history", "report")  # of the demo alone, and where all is asked
DOUBTFUL = frozenset({"real", "front-door", "front-door-2", "metadata"})  # worlds whose recordings deserve doubts
EXAM_SEED = 640064  # nothing hangs on it
EXAMS = {  # options of "pneucli exam" by condition
    "usual": ("--condition", "usual"),
    "messy": ("--condition", "messy"),
    "rate-200Hz": ("--condition", "rate-200Hz"),
    "third": ("--condition", "usual", "--size", "0.3333"),
}
EXAM_COUNTS = ("--cases", "3", "--nulls", "1")  # of each condition
T = TypeVar("T")
Edit = tuple[str, str]  # a regular expression, and what stands in its place

# what a user knows of the rig of which most raw files at the doors are
RIG: list[Edit] = [
    (rf'^(\w.*)"\? {re.escape(unit)}"', rf'\1"{value} {unit}"')
    for unit, value in (("bar", 7), ("cm^2", 8.04), ("mm", 200), ("cm^3", 30), ("l", 0.16), ("V", 5), ("kg", 2.2))
]


@dataclass(frozen=True)
class Case:
    """One case: a pipeline file, or raw files for ``init --from`` with the lines that a user then edits."""

    world: str
    name: str
    commands: Sequence[str]
    truth: Truth
    pipeline: Path | None = None
    raw: Sequence[Path] = ()
    edits: Sequence[Edit] = ()


@dataclass(frozen=True)
class World:
    """A world, and of how many cases, evenly spread, a sample consists."""

    name: str
    sample: int
    cases: Callable[[], list[Case]]


def own_program(python: str) -> list[str]:
    """Return the words that run the program of an interpreter's environment, not one in the current folder."""
    return [python, "-P", "-m", "pneucli"]


def shared_folder() -> Path:
    """Return the folder of shared cases: ``PNEUCLI_SHARED``, else ``shared`` beside the repository."""
    return Path(os.environ.get("PNEUCLI_SHARED") or ROOT.parent / "shared")


def sampled(cases: Sequence[T], count: int) -> list[T]:
    """Return cases that are evenly spread over all, the first among them."""
    if len(cases) <= count:
        return list(cases)
    return [cases[k * len(cases) // count] for k in range(count)]


def worlds(python: str, kept: Path, *, full: bool) -> list[World]:
    """Return the worlds that are at hand: fixtures and the exam always, the others where the shared folder is.

    Args:
        python: The interpreter whose program writes the exam.
        kept: Where the exam is kept.
        full: Whether the demo is asked for all that follows the diagnosis as well.

    """
    own = [
        World("fixtures", 7, lambda: fixtures(full=full)),
        World("exam", 5, lambda: exam(python, kept)),
    ]
    shared = shared_folder()
    if not shared.is_dir():
        return own
    return [
        *own,
        World("cases", 5, lambda: with_truths("cases", shared / "cases")),
        *(
            World(f"rigs-{rig}", count, lambda rig=rig: with_truths(f"rigs-{rig}", shared / "rigs" / rig))  # type: ignore[misc]
            for rig, count in (("plc", 1), ("bench", 2), ("seal", 2), ("process", 2))
        ),
        World("thesis-cases", 3, lambda: with_pages("thesis-cases", shared / "thesis-cases", AXIS)),
        World("real", 8, lambda: real(shared / "real")),
        World("front-door", 7, lambda: door("front-door", shared / "front-door")),
        World("front-door-2", 7, lambda: door("front-door-2", shared / "front-door-2")),
        World("metadata", 17, lambda: with_pages("metadata", shared / "metadata", READ)),
    ]


def with_truths(world: str, folder: Path) -> list[Case]:
    """Return cases that carry their truth."""
    return [Case(world, path.name, AXIS, truth_of(written), path / "pipeline.toml") for path, written in truths(folder)]


def with_pages(world: str, folder: Path, commands: Sequence[str]) -> list[Case]:
    """Return the pipelines of a folder whose truths are described."""
    known, out = described(world), []
    for path in sorted(folder.glob("*/*.toml")):
        name = f"{path.parent.name}/{path.stem}"
        out.append(Case(world, name, commands, described_truth(known.get(name, {})), path))
    return out


def door(world: str, folder: Path) -> list[Case]:
    """Return folders of raw files, each without its page, from which ``init`` makes a pipeline."""
    known, out = described(world), []
    for path in sorted(one for one in folder.iterdir() if one.is_dir()):
        raw = [one for one in sorted(path.iterdir()) if one.name != "README.md"]
        one = known.get(path.name)
        if one is not None:  # the others are no raw files
            out.append(Case(world, path.name, DOOR, described_truth(one), None, raw, [*_edits(one), *RIG]))
    return out


def real(folder: Path) -> list[Case]:
    """Return the project's pipelines of real recordings, and those that ``init`` makes of the others."""
    known = described("real")
    out = [
        Case("real", path.stem, AXIS, described_truth(known.get(path.stem, {})), path)
        for path in sorted((ROOT / "pipelines").glob("*.toml"))
        if "${PNEUCLI_DATA}" in path.read_text(encoding="utf-8")
    ]
    for name, one in known.items():
        if raw := [path for pattern in one.get("raw", []) for path in sorted(folder.glob(pattern))]:
            commands = one.get("commands", DOOR)
            out.append(Case("real", name, commands, described_truth(one), None, raw, [*_edits(one), *RIG]))
    return out


def fixtures(*, full: bool) -> list[Case]:
    """Return the fixtures: those with a pipeline file, the exports for ``init``, and last the demo."""
    folder, out = ROOT / "fixtures", []
    known = json.loads((folder / "truth.json").read_text(encoding="utf-8"))
    for name, one in sorted(known.items()):
        path, parameters = folder / name / "pipeline.toml", one["parameters"]
        hidden = {effect: {} for effect in one["hidden"]}
        if "drop" in parameters:  # a fixture of a friction model; its pipeline does not have the effect
            hidden["friction-hysteresis"] = {"drop": parameters["drop"]}
        truth = described_truth({"hidden": hidden})
        if name == "demo":
            demo = Case("fixtures", name, (*AXIS, *REST), truth, ROOT / "pipelines" / "demo.toml")
        elif path.is_file():
            out.append(Case("fixtures", name, AXIS, truth, path))
        else:
            out.append(Case("fixtures", name, DOOR, truth, None, sorted((folder / name).iterdir()), RIG))
    return [*out, demo] if full else out


def exam(python: str, kept: Path) -> list[Case]:
    """Return the cases of a small sealed exam, which the program writes where it does not exist yet."""
    out = []
    for condition, options in EXAMS.items():
        folder = kept / condition
        if not (folder / "complete").is_file():
            shutil.rmtree(folder, ignore_errors=True)
            asked = ["exam", str(folder), *EXAM_COUNTS, "--seed", str(EXAM_SEED), *options, "--quiet"]
            subprocess.run([*own_program(python), *asked], check=True, stdout=subprocess.DEVNULL)
            (folder / "complete").touch()
        out += [
            Case("exam", f"{condition}/{path.name}", AXIS, truth_of(written), path / "pipeline.toml")
            for path, written in truths(folder)
        ]
    return out


def source_digest(folder: Path) -> str:
    """Return a digest of the files of a package that are not generated."""
    files = (path for path in sorted(folder.rglob("*")) if path.suffix in {".py", ".json", ".toml", ".csv"})
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def _edits(one: Mapping[str, object]) -> list[Edit]:
    edits = one.get("edits", [])
    assert isinstance(edits, list)
    return [(pattern, text) for pattern, text in edits]
