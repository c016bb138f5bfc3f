"""What the columns of an unknown raw file may be, from their names; a guess that people are shown, and correct."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from pneucli.errors import UnitError
from pneucli.quantities import SIGNALS
from pneucli.units import parse_unit, same_dimension

# words that labs use, most telling first; matched against the name without its unit
_WORDS: dict[str, str] = {
    "time": r"t|time|zeit|timestamp|clock",
    "p_supply": r"p_?s(up(ply)?)?|p_?supply|supply|ps|p0|versorgung(sdruck)?|p_?source|p_?rail",
    "p_ref": r"p_?ref|p_?soll|p_?set(point)?",
    "x_ref": r"x_?ref|x_?soll|x_?set(point)?|pos_?ref|qg|setpoint|target",
    "u2": r"u_?2|u_?valve_?2|valve_?2|cmd_?2",
    "u": r"u|u_?1|u_?v(alve)?|valve|cmd|command|voltage|spannung|stellgr.*",
    "p1": r"p|p_?1|p_?a|pressure|pressure_?1|druck|druck_?1|chamber_?1|p_?chamber_?1",
    "p2": r"p_?2|p_?b|pressure_?2|druck_?2|chamber_?2|p_?chamber_?2",
    "x": r"x|pos|position|weg|stroke|displacement|laser|q|qm",
    "v": r"v|vel|velocity|speed|geschwindigkeit",
    "a": r"a|acc|accel|acceleration|beschleunigung",
    "force": r"f|force|kraft|load_?cell",
    "temperature": r"temp|temperature|temperatur|t_?gas|gas_?mean",
}
_UNIT = re.compile(r"^(.*?)[\s_]*[\[(<]([^\])>]+)[\])>]\s*$|^(.*?)\s+in\s+(\S+)$|^(.+)_([^_\s]+)$")


@dataclass(frozen=True)
class Guess:
    """One column and the signal it is taken for; ``signal`` is empty where nothing fits."""

    column: str
    signal: str
    unit: str
    gauge: bool


def guess(names: Sequence[str]) -> list[Guess]:
    """Return a guess for every column; each signal is given out once, to the first column that fits."""
    guesses: list[Guess] = []
    for column in names:
        found = _guess(column, {one.signal for one in guesses})
        guesses.append(found or Guess(column, "", "", False))
    return guesses


def _guess(column: str, taken: set[str]) -> Guess | None:
    stem, unit = _stem_and_unit(re.sub(r"^[^\[(]*/", "", column))
    for signal, words in _WORDS.items():
        fits = unit == "" or same_dimension(unit, SIGNALS[signal].unit)
        if signal not in taken and fits and re.fullmatch(words, stem, re.IGNORECASE):
            unit = unit or SIGNALS[signal].unit
            pressure = SIGNALS[signal].unit == "Pa" and not parse_unit(unit).absolute
            return Guess(column, signal, unit, pressure)
    return None


def _stem_and_unit(column: str) -> tuple[str, str]:
    """Cut ``"P1 [bar]"``, ``"t in ms"`` or ``"time_s"`` in two; no unit where the end of the name is none."""
    if match := _UNIT.match(column.strip()):
        stem, unit = (part for part in match.groups() if part is not None)
        try:
            parse_unit(unit)
        except UnitError:
            return column.strip(), ""
        return (column.strip(), "") if unit.isdigit() else (stem.strip(), unit)
    return column.strip(), ""
