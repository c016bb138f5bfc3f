"""``effects``: the catalogue."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli.cli import console
from pneucli.cli.options import Json

if TYPE_CHECKING:
    from pneucli.physics.declaration import Effect, Parameter


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("effects", help="The catalogue of physical effects, or one of them at length.")(_effects)


def _effects(
    effect: Annotated[str | None, typer.Argument(metavar="EFFECT", help="Its name.", show_default=False)] = None,
    json: Json = False,
) -> None:
    from pneucli.physics.effects import all_effects, select

    known = all_effects()
    chosen = list(known.values()) if effect is None else list(select([effect], known, "effects"))
    if json:
        console.answer({"schema": "pneucli/effects/1", "effects": [_content(one) for one in chosen]})
    elif effect is None:
        for one in chosen:
            parameters = ", ".join(f"{p.name} ({p.unit})" for p in one.parameters)
            print(f"{one.name:20} {one.part:13} {parameters}")
    else:
        print(_page(chosen[0]))


def _page(effect: Effect) -> str:
    lines = [f"{effect.name}: {effect.title}", f"part: {effect.part}", ""]
    lines += [f"  {p.name} in {p.unit}, {_range(p)}{p.title and ': ' + p.title}" for p in effect.parameters]
    lines += ["", effect.equation, "", f"in a residual: {effect.looks_like}"]
    if effect.twins:
        lines.append(f"easily taken for: {', '.join(effect.twins)}; what tells them apart: {effect.separate}")
    return "\n".join([*lines, f"source: {effect.source}"])


def _range(parameter: Parameter) -> str:
    null = "" if parameter.null is None else f", absent at {parameter.null}"
    return f"{parameter.lower:g} to {parameter.upper:g}{null}"


def _content(effect: Effect) -> dict[str, Any]:
    keys = ("name", "title", "part", "equation", "looks_like", "source")
    parameters = [
        {"name": p.name, "unit": p.unit, "null": p.null, "lower": p.lower, "upper": p.upper, "title": p.title}
        for p in effect.parameters
    ]
    return {key: getattr(effect, key) for key in keys} | {"twins": list(effect.twins), "parameters": parameters}
