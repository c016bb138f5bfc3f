"""``init``: a new pipeline file, from a commented example or from raw files that are looked at."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.config.json_schema import DIRECTIVE
from pneucli.config.json_schema import FILE as SCHEMA
from pneucli.errors import InputError
from pneucli.init.experiments import trial
from pneucli.init.file_groups import Kind, joined, kinds, natural, references, values_of
from pneucli.init.survey import Guess, Survey, survey
from pneucli.init.writer import References, quoted, text, waiting
from pneucli.io.artifacts import atomic_path
from pneucli.io.raw_file import RawFile
from pneucli.stages.schema import schema_text

NAME = "pipeline.toml"
HEAD = 2  # lines: where the schema is, and what CHECK means


def create(directory: Path, raw: Sequence[Path] = (), **stated: Any) -> dict[str, Any]:
    """Write ``directory / "pipeline.toml"`` and its schema; return what was written, with what was seen and guessed.

    ``raw`` holds files, folders and globs; ``stated`` says how texts are written, as :class:`RawFile` has it. Raises
    InputError where there is a pipeline already, where a raw file cannot be read, or where nothing in it is known.
    """
    target = directory / NAME
    if target.exists():
        raise InputError(str(target), "exists already", "a new folder", "choose another folder, or move the file away")
    left: list[str] = []
    surveys = [*_surveys(raw, stated, left)]
    together = joined(surveys)
    found = [together] if together else kinds(surveys)
    if left and not surveys:
        found_there = f"no recording among {len(left)} files: {left[0]}"
        raise InputError(str(raw[0]), found_there, "files of recorded numbers", "name them")
    content = _from_raw(directory, found) if raw else _example(directory)
    content = f"{DIRECTIVE}\n{content}"
    told = references(found)
    with atomic_path(target) as temporary:
        temporary.write_text(content, encoding="utf-8")
    with atomic_path(directory / SCHEMA) as temporary:
        temporary.write_text(schema_text(), encoding="utf-8")
    return {
        "schema": "pneucli/init/1",
        "pipeline": str(target),
        "columns": [row for kind in found for row in _columns(kind, told)],
        "left_out": left,
        "recordings": [_entry(kind) for kind in found],
        "fill_in": [{"line": line, "key": key} for line, key in waiting(content)],
        "check": [number for number, line in enumerate(content.splitlines(), 1) if "CHECK " in line and number > HEAD],
    }


def _surveys(raw: Sequence[Path], stated: dict[str, Any], left: list[str]) -> Iterator[Survey]:
    """Yield the files that are meant, each once: those of folders and of globs, which not every shell fills in.

    What lies in a folder and is no recording is left out, and said in ``left``.
    """
    seen = set()
    for path in raw:
        inside = [one for one in path.iterdir() if one.is_file()] if path.is_dir() else []
        hits = inside or ([path] if path.exists() else [Path(hit) for hit in glob.glob(str(path), recursive=True)])
        if not hits:
            raise InputError(str(path), "no such file", "a raw file, a folder of them or a glob", "check the path")
        for one in sorted((Path(os.path.abspath(hit)) for hit in hits), key=natural):
            if one in seen:
                continue
            seen.add(one)
            try:
                yield survey(RawFile(one, {}, **stated))
            except InputError as error:
                if len(inside) < 2:
                    raise
                left.append(f"{one.name}: {error.found}")


def _example(directory: Path) -> str:
    found = files("pneucli.stages").joinpath("templates", NAME).read_text(encoding="utf-8")
    return found.replace('"my-rig"', quoted(directory.resolve().name), 1)


def _from_raw(directory: Path, found: Sequence[Kind]) -> str:
    for kind in found:
        if not kind.signals.keys() & {"p1", "x"}:
            listed = ", ".join(f'"{one.column.name or one.column.key}"' for one in kind.idle)
            wanted = "a pressure or a position, by a name such as p1 or pos, or by a unit such as [bar] or [mm]"
            mend = f"name them in the file, or describe them by hand in [signals]; columns: {listed}"
            raise InputError(str(kind.surveys[0].path), "no column looks like a pressure or a position", wanted, mend)
    return text(directory, found, [trial(kind) for kind in found], references(found))


def _columns(kind: Kind, told: References) -> Iterator[dict[str, Any]]:
    """Yield what was seen of each column of a kind of file."""
    guesses: list[Guess] = [*kind.signals.values(), *kind.idle]
    for one in guesses:
        each = kind.numbers(one.signal) if one.signal else [values_of(survey, one) for survey in kind.surveys]
        values = np.concatenate(each)
        reference, why = told.get(one.unit, ("", "")) if one.signal.startswith("p") else ("", "")
        yield {
            "file": kind.file,
            "column": one.column.name or one.column.key,
            "signal": one.signal,
            "unit": one.unit,
            "gauge": reference == "gauge",
            "least": float(values.min()) if values.size else None,
            "median": float(np.median(values)) if values.size else None,
            "most": float(values.max()) if values.size else None,
            "why": "; ".join(filter(None, (one.note, why))),
        }


def _entry(kind: Kind) -> dict[str, Any]:
    held = [one.path.name for one in kind.held]
    return {
        "file": kind.file,
        "files": len(kind.surveys) + len(kind.more),
        "experiment": trial(kind).experiment,
        "held_out": held,
    }
