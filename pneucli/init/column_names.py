"""Part of ``init``: what the name and the unit of a column say of it.

A name is cut into words. A noun says the quantity (``Kolbenweg`` a position), other words which one of its kind
(``Soll`` a reference, ``source`` the supply); a unit alone says the quantity too.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from pneucli.init.survey_types import Column
from pneucli.io.file_units import RANGE, read_unit, with_unit_last
from pneucli.units import is_unit, same_dimension

_DRIVES = (
    "u op cmd command- valve- -valve vlv ventil- -ventil stell- control- duty pwm vanne valvula ansteuer- drive- input "
    "pump- relay- solenoid- magnet- switch- dac ao styr- ohjaus- sterow- rizen- vezerl- kumanda- comando mando stuur- "
    "szelep- управл- -阀- -弁- -指令-"
)
_VOLTAGE = (  # of a command, or of a sensor that another word names
    "voltage spannung -spannung volt spanning spenning napiecie napeti -feszultseg -jannite -spaending tensao tensiune "
    "напряж- -电压- -電圧- -전압-"
)

# whole words; with a hyphen behind or before them the beginnings or ends of words, with both the middles of words, as
# in languages that write no blanks; most telling first, without accents
NOUNS: dict[str, str] = {
    "time": "t ts time- -time zeit -zeit uhrzeit temps tiempo tempo tijd timestamp clock uhr stamp datetime "
    "elapsed filetime czas tout micros millis tid aika cas ido zaman timp время -时间- -時間- -시간-",
    "pressure": "p pa pb ps p0 pt pit pres press- -pressure druck -druck druck- pression "
    "presion pressione druk cisnienie tryck- -tryck trykk- -trykk tryk- -tryk paine- -paine tlak- nyomas- "
    "basinc- pressao presiune давлен- -压力- -圧力- -압력-",
    "force": "f force- -force kraft- -kraft fuerza effort kracht forza load- cell torque -moment moment tau voima sila "
    "ero kuvvet forca forta сила усилие -力-",
    "position": "x q y s qm qg pos position- -position travel weg- -weg hub -hub stroke displacement- laser "
    "lvdt encoder angle -winkel winkel- theta phi deplacement course posicion desplazamiento "
    "spostamento verplaatsing lage -lage asema polozenie poloha helyzet konum posicao pozitie "
    "positie положен- перемещ- -位置- -位移- -変位- -위치- -转角- -角度-",
    "velocity": "v vel velocity- speed- geschw- -geschwindigkeit vitesse velocidad velocita omega dq qd xd rpm "
    "hastighet- nopeus predkosc rychlost sebesseg hiz velocidade snelheid скорост- -速度- -속도-",
    "acceleration": "a acc accel- -beschleunigung beschleunigung- acceleracion aceleracion ускорен- -加速度-",
    "temperature": "temp temperature- -temperature temperatur- -temperatur temperatura temperature lampotila темпер- "
    "-温度- -온도-",
    "command": f"{_DRIVES} {_VOLTAGE}",
    "flow": "flow- -flow durchfluss- volumenstrom massenstrom mdot debit caudal portata flode- virtaus- vazao расход- "
    "-流量- -유량-",
}
_ALONE = {"position": (("pv",), ("sp",)), "pressure": (("supply",),)}  # names that tell where nothing else is said
MEANT = {  # by quantity: units that are written for others
    **{("force", "kg"): "kgf", ("force", "lb"): "lbf", ("force", "lbs"): "lbf", ("velocity", "1/min"): "rpm"},
}
_FEEDBACK = "spool- feedback monitor ist actual istwert"  # of a valve's own sensor, which is no command
_COMMANDED = "cmd command- control-"
_SENSED = ("pressure", "force", "position")
_COMPONENTS = ("x", "y", "z")
ANGLES = "angle winkel- -winkel theta phi q -转角- -角度-"
SUPPLY = (
    "s ps sup supply- -supply source- versorgung- speise- netz- rail- compressor- kompressor- line pump- p0 "
    "alimenta- matning- forsyning- syotto- zasilan- napaj- taplal- besleme- voeding- питан- подач- -供- -气源- -공급-"
)
UPSTREAM = "up upstream vor inlet in entry eingang primary"
DOWNSTREAM = "down downstream nach outlet out exit ausgang secondary back"
DIFFERENCE = "dp delta diff- differ- differenz- -differenz verschil- δ δp d1p Δ"  # of two pressures
# what recorders add, which is no signal of an axis
NO_SIGNAL = "battery- batter- akku- gyro- gyr id uid heart- depth- altitude- elevation-"
_RESULTS = "error err deviation abweichung fehler residual overshoot rmse std -norm"  # made of what was recorded
_SPOOL = "spool- valve- -valve vlv ventil- -ventil stem schieber- klappe- tiroir"
_TANK = "tank- kessel- reservoir- vessel- behalter- accumulator"
_REFERENCE = "ref soll- -soll reference- set setpoint- sp target- desired des goal- qg sollwert demand consigne"
_FIRST = "1 a pa i one first links left vorn front cap blind bottom boden kolbenseite head extend -无杆- -ヘッド-"
_SECOND = "2 b pb ii two second rechts right hinten rear rod stange- ring- stangenseite retract -有杆- -ロッド-"
_PLAIN_READINGS, _MEANS = "raw adc", "mean avg ave average"
_DERIVED = "filt- smooth- glatt- est- calc- model- sim-"  # made of another column
_SPREADS = "min max minimum maximum rms std stdev sd sigma pp"
_COUNTED = "count counts cnt cnts cts ticks inc incs pulses digits lsb"
_AMBIENT = "amb ambient- baro- atm atmos- umgebung- luftdruck- ambiant- ambiente"
ABSOLUTE, GAUGE = "abs absolut absolute", "gauge rel relativ relative uberdruck"

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
_ANGLE = re.compile("m?rad|deg|°")
_PLAIN = str.maketrans({"ß": "ss", "ø": "o", "Ø": "O", "æ": "ae", "ł": "l", "Ł": "L", "ı": "i", "đ": "d"})
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|[^\W\d_A-Za-z]+")
_VOICED = "\u3099\u309a"  # marks of Japanese letters, which are no accents
_JOINED = re.compile(r"(p)(sup\w*|tank|vessel|chamber|cyl\w*|rail|line|source|left|right|front|rear)")  # run together
_ANALOGUE = re.compile(r"(?i)\banalog(?:ue)?[\s_]+in(?:put)?(?=[\s_]?\d)")
_DELTA = re.compile("(?<![^\\W_])d ?P(?![a-z])")  # a difference of pressures
_INPUTS = ("ch", "channel", "kanal", "ai", "ain")  # of a recorder, whose number or letter is that of no chamber
_ELEMENT = re.compile(r"^(.*?)(_[^\W\d_]+)?\[(\d+)\]$")  # of an array: "pressure_pa[0]" is a first one
_NODE = re.compile(r"^(?:ns=\d+;)?[sgib]=")  # what OPC UA writes before a name
_VALUE = re.compile(r"(?i)(?<!^x)[\s_]+value[xy]?$")  # what recorders write behind a name, beside its stamps
_DOTTED = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")
_MARKED = re.compile(
    r"^([^\[(<{]+?),\s*(\S+)$|^(.*?)\s*\[\s*([^\]]*?)\s*\]\s*$|^(.*?)\s*[(<{]\s*([^\])>}]*)\s*[)>}]\s*$|"
    r"^(.+?)\s+in\s+(\S+)$|^()in\s+(\S+)$"
)
_FOREIGN = re.compile(r"[kmunµ][A-Z]")  # a unit that no rig records, such as mT, and no words
_SUFFIX = re.compile(r"^(.+)_([^_\s]+)$")
_NO_NAMES = re.compile(r"(?i)data|(?:y_)?values?|signal|samples|(?:in|out)\d*")  # last parts of paths that say nothing
_INNER = re.compile(r"(?<=\S)\s*\[[^\]]*\](?=\s*\([^()]*\)$)")  # a unit in front of its state: "Q [l/min] (ANR)"
_NOTE = re.compile(r"(?<=.)\s*\((?=[^()]*[:;=,])[^()]*\)\s*$")  # behind a name: "(LGR S/N: 203, SEN S/N: 2)"
_WORDS_TOO = ("in", "at", "min")  # units that are words of names more often: p_in is no pressure in inches
_SLASH = re.compile(r"^([^/\[(<]+?)\s*/\s*([^/\d][^/]*)$")  # "p / bar", as standards write it


@dataclass(frozen=True)
class ColumnName:
    """What a column's name says: its words, the unit at its end, and the quantities that its words may mean."""

    words: tuple[str, ...]
    unit: str

    def has(self, vocabulary: str) -> bool:
        """Whether one of the words is in a vocabulary."""
        return any(_matches(word, self.words) for word in vocabulary.split())

    @property
    def nouns(self) -> list[str]:
        """The quantities that the words may mean, but for time."""
        return [kind for kind, words in NOUNS.items() if kind != "time" and self.has(words)]

    @property
    def kind(self) -> str:
        """The quantity, by unit and noun; empty where they contradict each other, or say nothing."""
        nouns, by_unit = self.nouns, quantity_kind(self.unit)
        if not self.unit:
            return next(iter((*nouns, *(kind for kind, words in _ALONE.items() if self.words in words))), "")
        if meant := next((noun for noun in nouns if (noun, self.unit) in MEANT), ""):
            return meant
        scaled = by_unit == "command" or (not by_unit and self.unit == "%")
        if scaled and nouns and nouns[0] in _SENSED and not self.has(_DRIVES):
            return nouns[0]  # the output of a sensor, whose scale people have to say
        if by_unit in nouns or not nouns or by_unit == "flow":  # q is a flow as often as a joint's angle
            return by_unit
        if by_unit and not scaled and all(word in f"{_FIRST} {_SECOND} x y".split() for word in self.noun_words):
            return by_unit  # "Chamber A [psia]" is no acceleration, "Y [N]" no position
        return "command" if nouns == ["command"] and by_unit not in ("pressure", "position", "flow") else ""

    @property
    def is_voltage(self) -> bool:
        """Whether it says a voltage, and not that it drives something."""
        return self.has(_VOLTAGE) and not self.has(_DRIVES)

    @property
    def is_output(self) -> bool:
        """Whether it is in volts or amperes of a sensor, whose scale people have to say."""
        return self.kind in _SENSED and quantity_kind(self.unit) == "command"

    @property
    def noun_words(self) -> list[str]:
        """The words that mean a quantity, but for time."""
        return [one for one in self.words if ColumnName((one,), "").nouns]


def quantity_kind(unit: str) -> str:
    """Return the kind of quantity that a unit measures; empty where there is none that a rig records."""
    if _ANGLE.fullmatch(unit):
        return "position"
    return (
        ""
        if not unit or same_dimension(unit, "1")
        else next((kind for base, kind in _KINDS.items() if same_dimension(unit, base)), "")
    )


def is_angle(unit: str) -> bool:
    """Return whether a unit measures an angle."""
    return quantity_kind(unit) == "position" and not same_dimension(unit, "m")


def signal_scores(name: ColumnName) -> Iterator[tuple[str, float]]:
    """Yield the signals that a name may mean, and how well it fits."""
    kind, nouns = name.kind, name.nouns
    if name.has(f"{_RESULTS} {NO_SIGNAL}") or (kind == "pressure" and name.has(_AMBIENT)):
        return
    further = (name.has(f"{_DERIVED} {_MEANS} {_PLAIN_READINGS} {_COUNTED}"), name.is_output)
    certainty = 1.0 + (kind in nouns) - 0.5 * sum(further)
    is_reference = name.has(_REFERENCE) or ("command" in nouns and kind != "command" and name.has(_COMMANDED))
    second = name.has(_SECOND)
    if kind == "pressure":
        yield from ([("p_ref", certainty + 1.0)] if is_reference else _pressure_scores(name, certainty))
    elif kind == "position" and name.has(_SPOOL):
        yield "u", certainty - 1.5  # of the valve, not of the piston: what opens it, where nothing else is said to
    elif kind == "position":
        yield "x_ref" if is_reference else "x", certainty
    elif kind == "command" and (nouns or is_reference):  # volts alone may be any sensor's
        read_back = name.has(_FEEDBACK) and not is_reference
        yield "u", certainty - second - read_back
        yield from [("u2", certainty - (not second))] * (not read_back)
    elif kind not in ("", "time", "command") and not is_reference:  # volts alone may be any sensor's
        yield {"velocity": "v", "acceleration": "a"}.get(kind, kind), certainty


def _pressure_scores(name: ColumnName, certainty: float) -> Iterator[tuple[str, float]]:
    """Yield how well a pressure's name fits each place: one that says none is a chamber's, a difference has none."""
    if name.has(DIFFERENCE):
        return
    certainty -= 0.3 * name.has(_SPOOL)  # at the valve's port, and not in the chamber behind a hose
    if name.has(SUPPLY):
        yield "p_supply", certainty + 2.0  # more than a tank, whatever else it is called
    elif name.has(_TANK):
        yield "p_supply", certainty + 0.6
        yield "p1", certainty
    elif name.has(_SECOND):
        yield "p2", certainty + 0.8
    else:
        yield "p1", certainty + (0.8 if name.has(_FIRST) else 0.1)
        yield "p2", certainty


def read_name(column: Column, is_text: bool) -> ColumnName:
    """Return what the name of a column says; ``is_text``: whether a slash before a unit divides."""
    stem, unit, certainty = _stem_and_unit(column.name, is_text)
    if column.written and not column.unit:
        is_foreign = len(column.written) < 2 or _FOREIGN.fullmatch(column.written)
        return ColumnName(_words(stem if is_foreign else f"{stem} {column.written}"), "")
    name = ColumnName(_words(stem), column.unit or unit)
    if not certainty and not column.unit and name.nouns and quantity_kind(unit) not in name.nouns:
        return ColumnName(_words(f"{stem}_{unit}"), "")  # p_s is no pressure in seconds
    return name


def variants(names: Sequence[ColumnName]) -> set[int]:
    """Return the columns of a channel that another one has as it was read: filtered ones, and ranges of a mean."""
    kinds = ("", _MEANS, f"{_PLAIN_READINGS} {_VOLTAGE}", _DERIVED, f"{ABSOLUTE} {GAUGE}", _SPREADS)
    found: dict[object, list[tuple[int, int]]] = {}
    at = [
        [max(k for k, own in enumerate(kinds) if k == 0 or ColumnName((word,), "").has(own)) for word in name.words]
        for name in names
    ]
    raw = [name.has(_PLAIN_READINGS) or (name.has(_VOLTAGE) and name.kind in _SENSED) for name in names]
    stems = [
        tuple(word for word, k in zip(name.words, own, strict=True) if not k)
        for name, own in zip(names, at, strict=True)
    ]
    units = {stem: name.unit for stem, name, own in zip(stems, names, raw, strict=True) if not own}
    for n, (stem, name) in enumerate(zip(stems, names, strict=True)):
        unit = units.get(stem, name.unit) if raw[n] else name.unit
        found.setdefault((stem, unit), []).append((max(at[n], default=0), n))
    return {n for same in found.values() for kind, n in same if kind and (kind, n) != min(same)}


def is_spread(name: ColumnName) -> bool:
    """Return whether a name ends as the least, the most or the deviation of a channel does, and says what channel."""
    return len(name.words) > 1 and ColumnName(name.words[-1:], "").has(_SPREADS)


def _words(stem: str) -> tuple[str, ...]:
    plain = unicodedata.normalize("NFKD", stem.translate(_PLAIN))
    plain = "".join(letter for letter in plain if letter in _VOICED or not unicodedata.combining(letter))
    plain = _DELTA.sub("dp", _ANALOGUE.sub("ai", plain))
    parts = ("flow" if part == "Q" else part.lower() for part in _WORD.findall(unicodedata.normalize("NFC", plain)))
    found = (_JOINED.fullmatch(part) or part for part in parts)  # a joint's angle is a small q
    words = tuple(word for one in found for word in ((one,) if isinstance(one, str) else one.groups()))
    return words[:1] if words[:1] and words[0] in _INPUTS and all(len(word) < 3 for word in words[1:]) else words


def _stem_and_unit(column: str, is_text: bool) -> tuple[str, str, bool]:
    """Cut ``"P1 [bar]"``, ``"t in ms"``, ``"p / bar"`` or ``"time_s"`` in two, and say whether it is surely a unit.

    The unit is empty where the end of the name is none.
    """
    name = (
        _VALUE.sub("", _NODE.sub("", _NOTE.sub("", _INNER.sub("", RANGE.sub("", with_unit_last(column.strip()))))))
        or column.strip()
    )
    if _DOTTED.fullmatch(name) and _NO_NAMES.fullmatch(name.rpartition(".")[2]):
        name = _telling_part(name)
    parts = name.split()
    for count in (2, 1):
        unit = " ".join(parts[-count:])
        is_last = len(parts) > count and parts[-count] != "in" and parts[-count - 1] != "of"  # ms of day
        if is_last and _stands_behind_a_blank(unit, parts[:-count]):
            return " ".join(parts[:-count]).removesuffix(" /").removesuffix(" in"), unit, True
    for pattern in (_SLASH, _MARKED, _SUFFIX) if is_text else (_MARKED, _SUFFIX):
        if match := pattern.match(name):
            stem, unit = (part for part in match.groups() if part is not None)
            stem, unit = _longest_unit(stem, unit) if pattern is _SUFFIX else (stem, unit)
            if is_unit(unit) and read_unit(unit).is_plain and not unit.isdigit():
                certainty = (
                    pattern is not _SUFFIX or unit in ("V", "%") or (len(unit) > 1 and unit.lower() not in _WORDS_TOO)
                )
                return stem, unit, certainty
            if pattern is _MARKED:
                is_foreign = read_unit(unit).unit or len(unit) < 2 or _FOREIGN.fullmatch(unit)
                return stem if is_foreign else f"{stem} {unit}", "", True
    last = _telling_part(name)
    is_alone = len(last) > 2 and is_unit(last) and quantity_kind(last) not in ("", "time")  # "rpm", "psi"
    return last, last * is_alone, True


def _stands_behind_a_blank(text: str, stem: Sequence[str]) -> bool:
    """Return whether the end of a name is a unit and no word: "v mm/s", "valve V"; not "Pressure A", "Loop PV"."""
    if len(text) == 1:  # a letter is a unit where the words before it mean what it measures; A counts valves
        return text != "A" and is_unit(text) and quantity_kind(text) in ColumnName(_words(" ".join(stem)), "").nouns
    whole = text.count("(") == text.count(")") and text.count("[") == text.count("]")
    if not (text[0].isalpha() and whole and ("/" in text or " " not in text) and is_unit(text)):
        return False
    said = ColumnName(_words(" ".join(stem)), "")
    meant = len(text) > 2 and quantity_kind(text) in (said.kind, *said.nouns)  # "Abs Press PSIA", "Supply PSIA"
    return meant or not (text.isupper() or text.lower() in _WORDS_TOO)


def _longest_unit(stem: str, unit: str) -> tuple[str, str]:
    """Return a name and the unit at its end where that has underscores of its own: ``bar_g``, ``mm_s``, ``l_min``."""
    words = [*stem.split("_"), unit]
    for count in (3, 2):
        ends = words[-count:]
        for joined in ("_".join(ends), "/".join(ends)):
            if 1 < count < len(words) and is_unit(joined) and quantity_kind(joined):
                return "_".join(words[:-count]), joined
    return stem, unit


def _telling_part(name: str) -> str:
    """Return the last part of a path, or the one before where the last is a word such as ``data``."""
    return (_telling_parts(name) or [name])[-1]


def _telling_parts(name: str) -> list[str]:
    """Return the parts of a path up to the last that tells something."""
    dotted = _DOTTED.fullmatch(name) is not None
    parts = [part for part in re.split(r"\." if dotted else r"/(?![^\[(]*[\])])", name) if part]
    while len(parts) > 1 and (
        _NO_NAMES.fullmatch(parts[-1]) or (parts[-1] == "y" and ColumnName(_words(parts[-2]), "").nouns)
    ):
        parts.pop()
    return parts


def read_names(columns: Sequence[Column], is_text: bool) -> list[ColumnName]:
    """Return what the names of columns say; of paths that end alike the part before the end tells them apart."""
    from_zero = any(one.name.endswith("[0]") for one in columns)
    columns = [replace(one, name=_counted_from_one(one.name, from_zero)) for one in columns]
    ends = Counter(_telling_part(one.name) for one in columns)
    found = []
    for one in columns:
        parts = [part for part in _telling_parts(one.name)[:-1] if not _NO_NAMES.fullmatch(part)][-1:]
        last, before = _telling_part(one.name), [ColumnName(_words(part), "") for part in parts]
        element = last.isdigit() or any(len(name.words) == len(name.nouns) == 1 for name in before)
        both = parts and (ends[last] > 1 or (element and not read_name(one, is_text).nouns))
        found.append(read_name(replace(one, name=f"{parts[0]} {last}") if both else one, is_text))
    return _without_components(found)


def _counted_from_one(name: str, from_zero: bool) -> str:
    """Return the name of an element of an array with its number, from 1, before the unit: ``p_pa[0]`` as ``p_1_pa``."""
    return _ELEMENT.sub(lambda found: f"{found[1]}_{int(found[3]) + from_zero}{found[2] or ''}", name)


def _without_components(names: Sequence[ColumnName]) -> list[ColumnName]:
    """Return names without x, y and z where all three stand beside one word: parts of a vector, not positions."""
    stems = [tuple("" if word in _COMPONENTS else word for word in name.words) for name in names]
    letters = {
        stem: {name.words[stem.index("")] for name, own in zip(names, stems, strict=True) if own == stem}
        for stem in stems
        if stem.count("") == 1 and len(stem) > 1
    }
    vectors = {stem for stem, own in letters.items() if len(own) == len(_COMPONENTS)}
    return [
        replace(name, words=tuple(filter(None, stem))) if stem in vectors else name
        for name, stem in zip(names, stems, strict=True)
    ]


def _matches(word: str, words: Sequence[str]) -> bool:
    if word.startswith("-") and word.endswith("-"):
        return any(word[1:-1] in one for one in words)
    if word.startswith("-"):
        return any(one.endswith(word[1:]) for one in words)
    if word.endswith("-"):
        return any(one.startswith(word[:-1]) for one in words)
    return word in words
