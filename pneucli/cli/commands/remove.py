"""``remove``: remove effects from the model, identify again, show the error before and after."""

from typing import Annotated

import typer

from pneucli.cli.command import Command, File, HowToRun
from pneucli.cli.commands.add import change_effects
from pneucli.errors import require_known

HELP = "Remove effects from [model], identify anew, show the error before and after."
Effects = Annotated[list[str], typer.Argument(metavar="EFFECT", help="Names of effects.")]


def _remove(pipeline: File, effects: Effects, how: HowToRun = HowToRun()) -> None:
    from pneucli.config import load

    present = load(pipeline).model.effects
    require_known(effects, present, f"{pipeline}, [model] effects", 'no "{}" there', code="E030")
    change_effects(pipeline, [effect for effect in present if effect not in effects], how)


COMMAND = Command(_remove, "pneucli remove axis-7/pipeline.toml stribeck", HELP, place=120)
