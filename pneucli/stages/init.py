"""``init``: a new pipeline file, from a commented example or from raw files whose columns are guessed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomlkit

from pneucli.errors import InputError
from pneucli.io.artifacts import atomic_path
from pneucli.io.formats import open_raw
from pneucli.io.raw import RawFile
from pneucli.stages.guess import Guess, guess

NAME = "pipeline.toml"


def create(directory: Path, raw: Sequence[Path] = ()) -> dict[str, Any]:
    """Write ``directory / "pipeline.toml"`` and return what was written, with the guess for each raw column.

    Raises InputError where there is a pipeline already, or where a raw file cannot be read.
    """
    target = directory / NAME
    if target.exists():
        raise InputError(str(target), "exists already", "a new folder", "choose another folder, or move the file away")
    guesses = {path: _columns(path) for path in raw}
    text = _from_raw(directory, guesses) if raw else _example(directory)
    with atomic_path(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    shown = [{"file": str(path), **vars(one)} for path, found in guesses.items() for one in found]
    return {"schema": "pneucli/init/1", "pipeline": str(target), "columns": shown}


def describe(answer: dict[str, Any]) -> str:
    """Return the answer as text for people."""
    lines = [
        f'{Path(one["file"]).name}: "{one["column"]}" -> '
        + (f"{one['signal']} in {one['unit']}{', gauge' * one['gauge']}" if one["signal"] else "not taken")
        for one in answer["columns"]
    ]
    advice = (
        "check the guesses (units, gauge, use) before you run it" if lines else "describe your rig and recordings in it"
    )
    return "\n".join([*lines, f"wrote {answer['pipeline']}; {advice}"])


def _example(directory: Path) -> str:
    text = files("pneucli.stages").joinpath("templates", NAME).read_text(encoding="utf-8")
    return text.replace('"my-rig"', _quoted(directory.resolve().name), 1)


def _columns(path: Path) -> list[Guess]:
    if not path.is_file():
        raise InputError(str(path), "no such file", "a raw file", "check the path")
    return guess(open_raw(RawFile(path, {})).names)


def _from_raw(directory: Path, guesses: dict[Path, list[Guess]]) -> str:
    signals = {one.signal: one for found in guesses.values() for one in found if one.signal}
    if "time" not in signals:
        columns = ", ".join(f'"{one.column}"' for found in guesses.values() for one in found)
        raise InputError(str(next(iter(guesses))), "no column looks like time", "such as t [ms]", f"columns: {columns}")
    lines = ["# Guessed from the raw files' columns: check every line.", "[pipeline]"]
    lines += [f"name = {_quoted(directory.resolve().name)}", "", "[rig]", 'ambient_pressure = "1.013 bar"  # absolute']
    lines += ["", "[signals]", *(_signal(one) for one in signals.values())]
    for path, found in guesses.items():
        lines += ["", *_recording(directory, path, {one.signal for one in found})]
        own = [_signal(one) for one in found if one.signal and one != signals[one.signal]]
        lines += ["[recordings.signals]", *own] * bool(own)
    return "\n".join([*lines, "", "[model]", "effects = []", ""])


def _signal(one: Guess) -> str:
    reference = ', reference = "gauge"' if one.gauge else ""
    return f"{one.signal} = {{ column = {_quoted(one.column)}, unit = {_quoted(one.unit)}{reference} }}"


def _recording(directory: Path, path: Path, signals: set[str]) -> list[str]:
    experiment = "axis" if {"u", "x"} <= signals else "friction" if "x" in signals else "valve"
    file = os.path.relpath(path.resolve(), directory.resolve())
    lines = ["[[recordings]]", f"name = {_quoted(path.stem)}", f"file = {_quoted(file)}"]
    lines += [f'experiment = "{experiment}"', 'use = "train"  # "test" for recordings that are never fitted to']
    return [*lines, 'chamber_2 = "closed"  # or "open", "valve"'] if experiment == "axis" else lines


def _quoted(text: str) -> str:
    return tomlkit.item(text).as_string()
