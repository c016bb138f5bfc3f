"""Part of ``init``: what the columns of an unknown raw file may be, by name, unit and values, for people to correct.

A name is cut into words. A noun says the quantity (``Kolbenweg`` a position), other words which one of its kind
(``Soll`` a reference, ``source`` the supply); a unit alone says the quantity too. Each signal is given out once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.init.survey import Column, Guess, Survey
from pneucli.init.units import guess_unit
from pneucli.init.unnamed_columns import guess_unnamed_columns
from pneucli.io.text_sniffer import is_unit
from pneucli.units import same_dimension

# whole words, or with a hyphen before or behind them the ends of words; most telling first
_NOUNS: dict[str, str] = {
    "time": "t time- -time zeit -zeit uhrzeit temps tiempo tempo tijd timestamp clock uhr stamp datetime elapsed czas",
    "pressure": "p pa pb ps p0 press- -pressure druck -druck druck- pression presion pressione druk cisnienie",
    "force": "f force- -force kraft- -kraft fuerza effort kracht forza load- cell torque -moment moment tau",
    "position": "x q y s qm qg pos position- -position weg- -weg hub -hub stroke displacement- laser lvdt encoder "
    "angle -winkel winkel- theta phi deplacement course posicion desplazamiento spostamento verplaatsing",
    "velocity": "v vel velocity- speed- geschw- -geschwindigkeit vitesse velocidad velocita omega dq qd xd rpm",
    "acceleration": "a acc accel- -beschleunigung beschleunigung- acceleracion aceleracion",
    "temperature": "temp temperature- -temperature temperatur- -temperatur temperatura temperature",
    "command": "u cmd command- valve- -valve ventil- -ventil voltage spannung stell- control- duty pwm vanne valvula "
    "ansteuer- drive- volt input pump- relay- solenoid- magnet- switch-",
    "flow": "flow- -flow durchfluss- volumenstrom massenstrom mdot debit caudal portata",
}
_COMMANDED = "cmd command- control-"
_ANGLES = "angle winkel- -winkel theta phi q"
_SUPPLY = "s ps supply- source- versorgung- speise- netz- rail- compressor- kompressor- line pump- p0 alimentation"
_TANK = "tank- kessel- reservoir- vessel- behalter- accumulator"
_REFERENCE = "ref soll- -soll reference- set setpoint- target- desired des goal- qg sollwert demand consigne"
_FIRST = "1 a pa i one first links left vorn front cap blind bottom boden kolbenseite head extend"
_SECOND = "2 b pb ii two second rechts right hinten rear rod stange- ring- stangenseite retract"
_DERIVED = "filt- smooth- mean avg average glatt- est- calc- model- sim- raw adc"  # made of another column
_ABSOLUTE, _GAUGE = "abs absolut absolute", "gauge rel relativ relative uberdruck"

_KINDS = {
    "s": "time",
    "Pa": "pressure",
    "m": "position",
    "m/s": "velocity",
    "m/s^2": "acceleration",
    "N": "force",
    "N m": "force",
    "rad/s": "velocity",
    "rad/s^2": "acceleration",
    "K": "temperature",
    "V": "command",
    "A": "command",
    "kg/s": "flow",
    "m^3/s": "flow",
}
MIN_SWITCHED_SAMPLES, MAX_SWITCHED_LEVELS = 100, 3  # samples of one that was surely read, values of one that was not
_ANGLE = re.compile("m?rad|deg|°")
_PLAIN = str.maketrans("äöüéèó", "aoueeo")
_MARKED = re.compile(r"^(.*?)\s*[\[(<{]\s*([^\])>}]*)\s*[\])>}]\s*$|^(.+?)\s+in\s+(\S+)$|^(.+?),\s*(\S+)$")
_SUFFIX = re.compile(r"^(.+)_([^_\s]+)$")
_SLASH = re.compile(r"^([^/\[(<]+?)\s*/\s*([^/\d][^/]*)$")  # "p / bar", as standards write it


@dataclass(frozen=True)
class _Name:
    """What a column's name says: its words, the unit at its end, and the quantities that its words may mean."""

    words: tuple[str, ...]
    unit: str

    def has(self, vocabulary: str) -> bool:
        return any(_matches(word, self.words) for word in vocabulary.split())

    @property
    def nouns(self) -> list[str]:
        return [kind for kind, words in _NOUNS.items() if kind != "time" and self.has(words)]

    @property
    def kind(self) -> str:
        """The quantity, by unit and noun; empty where they contradict each other, or say nothing."""
        nouns, by_unit = self.nouns, quantity_kind(self.unit)
        if not self.unit:
            return next(iter(nouns), "")
        if by_unit in nouns or not nouns:
            return by_unit
        return "command" if nouns == ["command"] and by_unit not in ("pressure", "position", "flow") else ""


def guess_columns(surveys: Sequence[Survey]) -> list[Guess]:
    """Return a guess for every column of files that are alike, in their order.

    The columns are those of the first file; what only numbers tell, those of all files tell.
    """
    found = surveys[0]
    names = [_name(column, found.is_text) for column in found.columns]
    clock = _clock(found.columns, names)
    if not any(name.words for name in names):
        return guess_unnamed_columns(surveys, clock)
    taken = {clock: "time"} if clock is not None else {}
    offers = [
        (score, -n, signal) for n, one in enumerate(names) if n not in taken for signal, score in _signal_scores(one)
    ]
    for _, n, signal in sorted(offers, reverse=True):
        if -n not in taken and signal not in taken.values():
            taken[-n] = signal
    taken = {n: given for n, given in taken.items() if given in ("u", "u2") or not _is_switched(found.columns[n])}
    _assign_single_pressure(taken)
    return [_column_guess(surveys, n, taken.get(n, ""), names[n]) for n in range(len(names))]


def quantity_kind(unit: str) -> str:
    """Return the kind of quantity that a unit measures; empty where there is none that a rig records."""
    if _ANGLE.fullmatch(unit):
        return "position"
    return (
        ""
        if not unit or same_dimension(unit, "1")
        else next((kind for base, kind in _KINDS.items() if same_dimension(unit, base)), "")
    )


def _column_guess(alike: Sequence[Survey], n: int, signal: str, name: _Name) -> Guess:
    column = alike[0].columns[n]
    reference = "absolute" if name.has(_ABSOLUTE) else "gauge" if name.has(_GAUGE) else ""
    if not signal:
        return Guess(column, "", name.unit)
    if signal in ("u", "u2") and name.unit and quantity_kind(name.unit) != "command":
        return Guess(column, signal, "V", False, "", f"{name.unit} taken for volts, one for one")
    if name.unit:
        return Guess(column, signal, name.unit, True, reference if name.kind == "pressure" else "")
    known = (
        column.finite_values if signal == "time" else np.concatenate([one.columns[n].finite_values for one in alike])
    )
    unit, note = guess_unit(signal, known, angle=name.has(_ANGLES))
    return Guess(column, signal, unit, False, reference if name.kind == "pressure" else "", note)


def _clock(columns: Sequence[Column], names: Sequence[_Name]) -> int | None:
    """Return the column that is the clock: one that rises, and is called so, or comes first and is called nothing."""
    rising = [n for n, column in enumerate(columns) if column.where is None and _is_increasing(column)]
    called = [n for n in rising if names[n].has(_NOUNS["time"]) or quantity_kind(names[n].unit) == "time"]
    labview = [n for n in rising if names[n].words == ("x", "value")]
    nameless = [n for n in rising if not names[n].words]
    return next(iter([*called, *labview, *nameless]), None)


def _is_increasing(column: Column) -> bool:
    steps = np.diff(column.finite_values)
    return bool(steps.size) and float(np.mean(steps > 0)) > 0.5 and float(np.mean(steps >= 0)) > 0.98


def _is_switched(column: Column) -> bool:
    """Return whether a column changes between a few values, as something that is set and no sensor."""
    return (
        column.finite_values.size > MIN_SWITCHED_SAMPLES
        and 1 < np.unique(column.finite_values).size <= MAX_SWITCHED_LEVELS
    )


def _signal_scores(name: _Name) -> Iterator[tuple[str, float]]:
    """Yield the signals that a name may mean, and how well it fits."""
    kind, nouns = name.kind, name.nouns
    sure = 1.0 + bool(nouns) - 0.5 * name.has(_DERIVED)
    is_reference = name.has(_REFERENCE) or ("command" in nouns and kind != "command" and name.has(_COMMANDED))
    second = name.has(_SECOND)
    if kind == "pressure":
        yield from ([("p_ref", sure + 1.0)] if is_reference else _pressure_scores(name, sure))
    elif kind == "position":
        yield "x_ref" if is_reference else "x", sure
    elif kind == "command" and nouns:  # volts alone may be any sensor's
        yield "u", sure - second
        yield "u2", sure - (not second)
    elif kind:
        yield {"velocity": "v", "acceleration": "a"}.get(kind, kind), sure


def _pressure_scores(name: _Name, sure: float) -> Iterator[tuple[str, float]]:
    """Yield how well a pressure's name fits each place; one that says no place is a chamber's."""
    if name.has(_SUPPLY):
        yield "p_supply", sure + 1.0
    elif name.has(_TANK):
        yield "p_supply", sure + 0.6
        yield "p1", sure
    elif name.has(_SECOND):
        yield "p2", sure + 0.8
    else:
        yield "p1", sure + (0.8 if name.has(_FIRST) else 0.1)
        yield "p2", sure


def _assign_single_pressure(taken: dict[int, str]) -> None:
    """A pressure that stands alone is that of chamber 1, whatever it is called."""
    if "p1" not in taken.values():
        for n in [n for signal in ("p2", "p_supply") for n, given in taken.items() if given == signal][:1]:
            taken[n] = "p1"


def _name(column: Column, is_text: bool) -> _Name:
    stem, unit, sure = _stem_and_unit(column.name, is_text)
    name = _Name(_words(stem), column.unit or unit)
    if not sure and not column.unit and name.nouns and not name.kind:
        return _Name(_words(f"{stem}_{unit}"), "")  # p_s is no pressure in seconds
    return name


def _words(stem: str) -> tuple[str, ...]:
    plain = stem.translate(_PLAIN)
    return tuple(part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", plain))


def _stem_and_unit(column: str, is_text: bool) -> tuple[str, str, bool]:
    """Cut ``"P1 [bar]"``, ``"t in ms"``, ``"p / bar"`` or ``"time_s"`` in two, and say whether it is surely a unit.

    The unit is empty where the end of the name is none.
    """
    name = column.strip()
    for pattern in (_SLASH, _MARKED, _SUFFIX) if is_text else (_MARKED, _SUFFIX):
        if match := pattern.match(name):
            stem, unit = (part for part in match.groups() if part is not None)
            if is_unit(unit) and not unit.isdigit():
                return stem, unit, pattern is not _SUFFIX or len(unit) > 1 or unit == "V"
            if pattern is _MARKED:
                return stem, "", True
    return re.sub(r"^[^\[(]*/", "", name), "", True


def _matches(word: str, words: Sequence[str]) -> bool:
    if word.startswith("-"):
        return any(one.endswith(word[1:]) for one in words)
    if word.endswith("-"):
        return any(one.startswith(word[:-1]) for one in words)
    return word in words
