"""``add`` and ``remove``: change the model's effects, identify again, show the error before and after."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli import messages
from pneucli.cli import console, examples
from pneucli.cli.options import File, Json, Out, Quiet, Verbose, open_pipeline_file
from pneucli.errors import InputError, did_you_mean

ADD = "Add effects to [model], identify anew, show the error before and after."
REMOVE = "Remove effects from [model], identify anew, show the error before and after."
Effects = Annotated[list[str], typer.Argument(metavar="EFFECT", help="Names of effects.", show_default=False)]
OptionalEffects = Annotated[
    list[str] | None, typer.Argument(metavar="EFFECT", help="Names of effects.", show_default=False)
]
Suggested = Annotated[bool, typer.Option("--suggested", help="What the diagnosis names, in its order.")]


def register(app: typer.Typer) -> None:
    """Add the two commands."""
    app.command("add", help=ADD, epilog=examples.example_line("add"))(_add)
    app.command("remove", help=REMOVE, epilog=examples.example_line("remove"))(_remove)


def _add(
    pipeline: File,
    effects: OptionalEffects = None,
    suggested: Suggested = False,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    from pneucli.config import load, plugin_files
    from pneucli.physics.effects import all_effects, select_effects

    if not effects and not suggested:
        raise InputError(
            "pneucli add", "no effect", "names of effects, or --suggested", "pneucli effects lists them", code="E001"
        )
    config = load(pipeline)
    chosen = [*(effects or []), *(_stage_answer("diagnose", pipeline, out, quiet)["missing"] if suggested else [])]
    select_effects(chosen, all_effects(plugin_files(config)))
    _change(pipeline, list(dict.fromkeys([*config.model.effects, *chosen])), out, json, quiet, verbose)


def _remove(
    pipeline: File,
    effects: Effects,
    out: Out = None,
    json: Json = False,
    verbose: Verbose = False,
    quiet: Quiet = False,
) -> None:
    from pneucli.config import load

    present = load(pipeline).model.effects
    for effect in effects:
        if effect not in present:
            raise InputError(
                f"{pipeline}, [model] effects", f'no "{effect}" there', mend=did_you_mean(effect, present), code="E030"
            )
    _change(pipeline, [effect for effect in present if effect not in effects], out, json, quiet, verbose)


def _change(file: Path, effects: list[str], out: Path | None, json: bool, quiet: bool, verbose: bool) -> None:
    from pneucli.config.effect_edit import set_effects

    before = _stage_answer("compare", file, out, quiet)
    present = before["model"]["effects"]
    if effects != present:
        set_effects(file, effects)
    after = _stage_answer("compare", file, out, quiet)
    answer = _difference(before, after)
    if json:
        console.print_json(answer)
        return
    console.print_text(messages.render("edit", answer, str(file)))
    if verbose:
        console.print_text(messages.render("compare", after, str(file), verbose=True))


def _stage_answer(stage: str, file: Path, out: Path | None, quiet: bool) -> dict[str, Any]:
    say = console.ignore_message if quiet else console.print_message
    with console.progress(quiet) as progress:
        return open_pipeline_file(file, out).update([stage], None, progress, say)[stage].answer


def _difference(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    from pneucli.stages.diff import error_changes

    was, now = before["model"]["effects"], after["model"]["effects"]
    added = [name for name in now if name not in was]
    return {
        "schema": "pneucli/edit/1",
        "pipeline": after["pipeline"],
        "effects": now,
        "added": added,
        "removed": [name for name in was if name not in now],
        "before": before["error"],
        "after": after["error"],
        "lack_of_fit": after.get("lack_of_fit"),
        "recordings": error_changes(before["channels"], after["channels"]),
        "parameters": {n: p for n, p in after["model"]["parameters"].items() if n.partition(".")[0] in added},
    }
