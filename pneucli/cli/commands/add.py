"""``add``: add effects to the model, identify again, show the error before and after."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from pneucli.cli.command import Command, HowToRun
from pneucli.cli.options import File
from pneucli.errors import InputError

HELP = "Add effects to [model], identify anew, show the error before and after."
Effects = Annotated[list[str] | None, typer.Argument(metavar="EFFECT", help="Names of effects.", show_default=False)]
Suggested = Annotated[bool, typer.Option("--suggested", help="What the diagnosis names, in its order.")]


def _add(
    pipeline: File,
    effects: Effects = None,
    suggested: Suggested = False,
    how: HowToRun = HowToRun(),
) -> None:
    from pneucli.config import load, plugin_files
    from pneucli.physics.effects import all_effects, select_effects

    if not effects and not suggested:
        raise InputError(
            "pneucli add", "no effect", "names of effects, or --suggested", "pneucli effects lists them", code="E001"
        )
    config = load(pipeline)
    chosen = [
        *(effects or []),
        *(how.update(how.open(pipeline), "diagnose")["diagnose"].answer["missing"] if suggested else []),
    ]
    select_effects(chosen, all_effects(plugin_files(config)))
    change_effects(pipeline, list(dict.fromkeys([*config.model.effects, *chosen])), how)


def change_effects(file: Path, effects: list[str], how: HowToRun) -> None:
    """Write the effects into the file; print the error of the model before and after."""
    from pneucli.config.effect_edit import set_effects

    before = how.update(how.open(file), "compare")["compare"].answer
    present = before["model"]["effects"]
    if effects != present:
        set_effects(file, effects)
    after = how.update(how.open(file), "compare")["compare"].answer
    answer = _difference(before, after)
    how.show("edit", answer, file)
    if how.verbose and not how.json:
        how.show("compare", after, file)


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
