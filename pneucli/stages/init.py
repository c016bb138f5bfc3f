"""``init``: a new pipeline file, from a commented example or from raw files that are looked at."""

import glob
import os
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.config.key_reference import DIRECTIVE, schema_text
from pneucli.config.key_reference import SCHEMA_FILE as SCHEMA
from pneucli.errors import InputError
from pneucli.init.columns import guess_columns
from pneucli.init.components import Component, Question, values_of, with_components, with_values
from pneucli.init.components import questions as asked_questions
from pneucli.init.experiments import guess_experiment, limits_of, refuse_unusable
from pneucli.init.file_groups import (
    FileGroup,
    column_values,
    group_files,
    join_files_of_one_recording,
    pressure_references,
)
from pneucli.init.survey import survey_parts
from pneucli.init.survey_types import Guess, Survey
from pneucli.init.writer import References, fields_to_fill_in, pipeline_text, toml_string
from pneucli.io.artifacts import write_text
from pneucli.io.formats import recordings_in_archive
from pneucli.io.raw_file import RawFile
from pneucli.messages.init import Answer, Column, Kind, Waiting
from pneucli.paths import archive_members, natural_order

NAME = "pipeline.toml"
HEADER_LINES = 2  # lines: where the schema is, and what CHECK means


def create(directory: Path, raw: Sequence[Path] = (), *, parts: Sequence[Component] = (), **stated: Any) -> Answer:
    """Write ``directory / "pipeline.toml"`` and its schema; return what was written, with what was seen and guessed.

    ``raw`` holds files, folders and globs; ``parts`` are the rig's cylinder and valve, by part number; ``stated`` says
    how texts are written, as :class:`RawFile` has it. Raises InputError where there is a pipeline already, where a raw
    file cannot be read, or where nothing in it is known.
    """
    target = directory / NAME
    if target.exists():
        raise InputError(
            str(target), "exists already", "a new folder", "choose another folder, or move the file away", code="E006"
        )
    left: list[str] = []
    surveys = [*_survey_files(raw, stated, left)]
    if left and not surveys:
        more = f" (and {len(left) - 1} more files)" if len(left) > 1 else ""
        raise InputError(
            str(raw[0]),
            f"no recording in {left[0]}{more}",
            "files of recorded numbers",
            "export them as CSV",
            code="E041",
        )
    together = join_files_of_one_recording(surveys)
    found = _recordings([together] if together else group_files(surveys), left)
    content = _from_raw(directory, found) if raw else _example(directory)
    content = "\n".join([content, *(f"# left out: {one}" for one in left)]) + "\n" * bool(left)
    left += dict.fromkeys(f"{one.path.name}: {text}" for kind in found for one in kind.surveys for text in one.unused)
    content = f"{DIRECTIVE}\n{with_components(content, parts) if parts else content}"
    references = pressure_references(found)
    write_text(target, content)
    write_text(directory / SCHEMA, schema_text())
    return Answer(
        schema="pneucli/init/1",
        pipeline=str(target),
        columns=[column for kind in found for column in _columns_of(kind, references)],
        left_out=left,
        cannot=[*limits_of(found)] if raw else [],
        recordings=[_kind_of(kind) for kind in found],
        fill_in=_waiting(content),
        check=[
            number for number, line in enumerate(content.splitlines(), 1) if "CHECK " in line and number > HEADER_LINES
        ],
    )


def _waiting(content: str) -> list[Waiting]:
    return [Waiting(line, key) for line, key in fields_to_fill_in(content)]


def questions(waiting: Sequence[Waiting]) -> list[Question]:
    """Return what is to be asked for the fields that wait, as :func:`create` returns them under ``fill_in``."""
    return asked_questions([one.key for one in waiting])


def refusal(answers: Mapping[str, str]) -> str:
    """Return why answers to :func:`questions` cannot be taken, and what is wanted; empty where they can."""
    try:
        values_of(answers)
    except InputError as error:
        return f"{error.found}; wanted: {error.wanted}"
    return ""


def fill_in(path: Path, answers: Mapping[str, str]) -> list[Waiting]:
    """Write answers to :func:`questions` into the pipeline file; return what still waits, as :func:`create` does.

    Raises InputError where an answer is no quantity of its kind.
    """
    content = with_values(path.read_text(encoding="utf-8"), values_of(answers))
    write_text(path, content)
    return _waiting(content)


def _survey_files(raw: Sequence[Path], stated: dict[str, Any], left: list[str]) -> Iterator[Survey]:
    """Yield the files that are meant, each once: those of folders and of globs, which not every shell fills in.

    Files of a folder that are no recordings are left out and listed in ``left``.
    """
    found = list(dict.fromkeys(one for path in raw for one in _files_at(path)))
    for one in found:
        try:
            parts = survey_parts(RawFile(one, {}, **stated))
            for part in parts:
                refuse_unusable(part, guess_columns([part]))
            yield from parts
        except InputError as error:
            if len(found) < 2:
                raise
            left.append(f"{one.name}: {error.found}")


def _files_at(path: Path) -> Iterator[Path]:
    """Yield the files that a path means: those of a folder, of a glob, and of an archive of several recordings."""
    inside = [one for one in path.iterdir() if one.is_file()] if path.is_dir() else []
    hits = inside or ([path] if path.exists() else [Path(hit) for hit in glob.glob(str(path), recursive=True)])
    hits = hits or archive_members(path)
    if not hits:
        raise InputError(
            str(path), "no such file", "a raw file, a folder of them or a glob", "check the path", code="E002"
        )
    for one in sorted((Path(os.path.abspath(hit)) for hit in hits), key=natural_order):
        members = recordings_in_archive(one)
        yield from sorted(members, key=natural_order) if len(members) > 1 else [one]


def _example(directory: Path) -> str:
    found = files("pneucli.stages").joinpath("templates", NAME).read_text(encoding="utf-8")
    return found.replace('"my-rig"', toml_string(directory.resolve().name), 1)


def _recordings(found: Sequence[FileGroup], left: list[str]) -> Sequence[FileGroup]:
    """Return the groups that have a pressure or a position, and a clock; where none has one, all of them.

    The others are listed in ``left``: a file without a clock beside recordings is a table of results.
    """
    needs = (
        (("p1", "x"), "no column looks like a pressure or a position"),
        (("time",), "no column rises like a clock"),
    )
    for names, reason in needs:
        usable = [one for one in found if one.steady or not one.signals.keys().isdisjoint(names)]
        if usable:
            left += [f"{one.path.name}: {reason}" for kind in found if kind not in usable for one in kind.surveys]
            found = usable
    return found


def _from_raw(directory: Path, found: Sequence[FileGroup]) -> str:
    return pipeline_text(directory, found, [guess_experiment(kind) for kind in found], pressure_references(found))


def _columns_of(kind: FileGroup, references: References) -> Iterator[Column]:
    """Yield what was seen of each column of a kind of file."""
    guesses: list[Guess] = [*kind.signals.values(), *kind.unused]
    for one in guesses:
        each = kind.raw_numbers(one.signal) if one.signal else [column_values(survey, one) for survey in kind.surveys]
        values = np.concatenate(each)
        reference = references.get(one.unit) if one.signal.startswith("p") else None
        yield Column(
            file=kind.file,
            part=kind.surveys[0].raw.part,
            run=kind.surveys[0].run,
            column=one.column.name or one.column.key,
            signal=one.signal,
            unit="?" if one.ask_unit else one.unit,
            gauge=reference is not None and reference.kind == "gauge" and not one.ask_unit,
            least=float(values.min()) if values.size else None,
            median=float(np.median(values)) if values.size else None,
            most=float(values.max()) if values.size else None,
            why="; ".join(filter(None, (one.why, reference.why if reference else ""))),
        )


def _kind_of(kind: FileGroup) -> Kind:
    return Kind(
        file=kind.file,
        part=kind.surveys[0].raw.part,
        run=kind.surveys[0].run,
        files=len(kind.surveys) + len(kind.further_files),
        experiment=guess_experiment(kind).experiment,
        held_out=[one.path.name for one in kind.held_out],
    )
