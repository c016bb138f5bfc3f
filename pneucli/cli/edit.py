"""``add`` and ``remove``: change the model's effects, identify anew, show the error before and after."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli.cli import console
from pneucli.cli.options import File, Json, Out, Quiet, opened
from pneucli.errors import InputError, did_you_mean

Effects = Annotated[list[str], typer.Argument(metavar="EFFECT", help="Names of effects.", show_default=False)]


def register(app: typer.Typer) -> None:
    """Add the two commands."""
    app.command("add", help="Add effects to [model], identify anew, show the error before and after.")(_add)
    app.command("remove", help="Remove effects from [model], identify anew, show the error before and after.")(_remove)


def _add(pipeline: File, effects: Effects, out: Out = None, json: Json = False, quiet: Quiet = False) -> None:
    from pneucli.config import load, plugin_files
    from pneucli.physics.effects import all_effects, select

    config = load(pipeline)
    select(effects, all_effects(plugin_files(config)))
    _change(pipeline, list(dict.fromkeys([*config.model.effects, *effects])), out, json, quiet)


def _remove(pipeline: File, effects: Effects, out: Out = None, json: Json = False, quiet: Quiet = False) -> None:
    from pneucli.config import load

    present = load(pipeline).model.effects
    for effect in effects:
        if effect not in present:
            raise InputError(f"{pipeline}, [model] effects", f'no "{effect}" there', mend=did_you_mean(effect, present))
    _change(pipeline, [effect for effect in present if effect not in effects], out, json, quiet)


def _change(file: Path, effects: list[str], out: Path | None, json: bool, quiet: bool) -> None:
    from pneucli.config.edit import set_effects

    before = _compare(file, out, quiet)
    set_effects(file, effects)
    after = _compare(file, out, quiet)
    errors = {"before": before["error"], "after": after["error"]}
    if json:
        console.answer({"schema": "pneucli/edit/1", "pipeline": after["pipeline"], "effects": effects, **errors})
        return
    print(f"effects: {', '.join(effects) or 'none'}")
    for when, error in errors.items():
        print(f"error {when:7}" + ", ".join(f"{use} {_number(value)}" for use, value in error.items()))


def _compare(file: Path, out: Path | None, quiet: bool) -> dict[str, Any]:
    say = console.hush if quiet else console.say
    with console.progress(quiet) as progress:
        return opened(file, out).bring_up(["compare"], None, progress, say)["compare"].answer


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.3g}"
