"""Words of process plants in those of the other keys: chamber 2 at ambient for good, travel in percent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pneucli.errors import UnitError
from pneucli.units import parse_quantity

PERCENT = "%"


def in_words_of_the_bench(document: Any) -> Any:
    """Return the tables of a pipeline file in which chamber 2 and travel are stated as on a bench.

    ``[rig.cylinder] chamber_2 = "ambient"`` is ``chamber_2 = "open"`` of every recording that says nothing else, and
    ``unit = "%"`` of a position is a share of the stroke. What is at fault is left to the checks that follow.
    """
    cylinder = _table(_table(document, "rig"), "cylinder")
    changed = dict(document) if isinstance(document, Mapping) else document
    if cylinder.get("chamber_2") == "ambient" and isinstance(changed.get("recordings"), list):
        changed["recordings"] = [_opened(one) for one in changed["recordings"]]
    if (stroke := _stroke(cylinder)) is not None and isinstance(changed.get("signals"), Mapping):
        changed["signals"] = _in_metres(changed["signals"], stroke)
    return changed


def _table(document: Any, key: str) -> Mapping[str, Any]:
    found = document.get(key) if isinstance(document, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _opened(recording: Any) -> Any:
    moves = isinstance(recording, Mapping) and recording.get("experiment") in ("axis", "closed-loop")
    return {"chamber_2": "open", **recording} if moves else recording


def _stroke(cylinder: Mapping[str, Any]) -> float | None:
    try:
        return parse_quantity(cylinder["stroke"], "m")
    except (KeyError, UnitError):
        return None


def _in_metres(signals: Mapping[str, Any], stroke: float) -> dict[str, Any]:
    def metres(name: str, one: Any) -> Any:
        if name not in ("x", "x_ref") or not isinstance(one, Mapping) or one.get("unit") != PERCENT:
            return one
        share = stroke / 100.0
        counted = {key: one.get(key, plain) for key, plain in (("scale", 1.0), ("offset", 0.0))}
        return {**one, "unit": "m"} | {k: v * share if isinstance(v, int | float) else v for k, v in counted.items()}

    return {name: metres(name, one) for name, one in signals.items()}
