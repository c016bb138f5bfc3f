"""``add``: add effects to the model, identify again, show the error before and after."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli.cli.command import Command, show, update
from pneucli.cli.options import File, Json, Out, Quiet, Verbose, open_pipeline_file
from pneucli.errors import InputError

HELP = "Add effects to [model], identify anew, show the error before and after."
Effects = Annotated[list[str] | None, typer.Argument(metavar="EFFECT", help="Names of effects.", show_default=False)]
Suggested = Annotated[bool, typer.Option("--suggested", help="What the diagnosis names, in its order.")]


def _add(
    pipeline: File,
    effects: Effects = None,
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
    change_effects(pipeline, list(dict.fromkeys([*config.model.effects, *chosen])), out, json, quiet, verbose)


def change_effects(file: Path, effects: list[str], out: Path | None, json: bool, quiet: bool, verbose: bool) -> None:
    """Write the effects into the file; print the error of the model before and after."""
    from pneucli.config.effect_edit import set_effects

    before = _stage_answer("compare", file, out, quiet)
    present = before["model"]["effects"]
    if effects != present:
        set_effects(file, effects)
    after = _stage_answer("compare", file, out, quiet)
    answer = _difference(before, after)
    show("edit", answer, file, json)
    if verbose and not json:
        show("compare", after, file, json, verbose)


def _stage_answer(stage: str, file: Path, out: Path | None, quiet: bool) -> dict[str, Any]:
    return update(open_pipeline_file(file, out), [stage], quiet)[stage].answer


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


COMMAND = Command(_add, "pneucli add axis-7/pipeline.toml --suggested", HELP, place=110)
