"""Read what a page asks for; raises InputError for anything else."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from typing import Any

from aiohttp import web

from pneucli.errors import InputError
from pneucli.workbench.live_model import Variant


def unreadable(name: str, wanted: str) -> InputError:
    """Return the error for a part of a request that is not as the page sends it."""
    return InputError("the workbench", f"{name} cannot be read", wanted, code="E090")


async def json_body(request: web.Request) -> dict[str, Any]:
    """Return the JSON object of a request."""
    try:
        found = json.loads(await request.text(), parse_constant=lambda name: None)
    except (ValueError, UnicodeDecodeError, RecursionError) as error:
        raise unreadable("the request", "a JSON object") from error
    if not isinstance(found, dict):
        raise unreadable("the request", "a JSON object")
    return found


def text_of(asked: Mapping[str, Any], name: str) -> str:
    """Return a text of a request."""
    value = asked.get(name)
    if not isinstance(value, str):
        raise unreadable(name, "a text")
    return value


def number(value: Any) -> float:
    """Return a finite number of a request."""
    usable = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf
    if not usable or abs(value) > sys.float_info.max:
        raise unreadable("a number", "a finite number")
    return float(value)


def interval_of(value: Any) -> tuple[float, float] | None:
    """Return begin and end in s of an interval of time; None for everything."""
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise unreadable("interval", "two numbers")
    return number(value[0]), number(value[1])


def variant_of(asked: Mapping[str, Any]) -> Variant:
    """Return the model that a page asks for."""
    values, effects = asked.get("values", {}), asked.get("effects")
    if not isinstance(values, dict):
        raise unreadable("values", "numbers by name")
    if effects is not None and not (isinstance(effects, list) and all(isinstance(one, str) for one in effects)):
        raise unreadable("effects", "names of effects")
    return Variant(
        {str(name): number(value) for name, value in values.items()},
        None if effects is None else tuple(effects),
        bool(asked.get("free_run")),
        bool(asked.get("step")),
    )
