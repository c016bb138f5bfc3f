"""The worlds of ``benchmarks.score``: their cases, the commands that are asked of each, and what is true of it."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from benchmarks.truths import Truth, described, described_truth, truth_of, truths

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
