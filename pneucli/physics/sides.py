"""Effects of one chamber, its hose or its sensor: the same declaration at the ports of either side.

An effect is declared once, for chamber 1 or for both chambers. Its variant ``NAME:2`` enters at the ports of chamber 2
with the same equations and parameters; an effect that is declared for both has variants ``NAME:1`` and ``NAME:2``.
"""

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

from pneucli.experiments import Part
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import PORTS

Chamber = Literal[1, 2]
SEPARATOR = ":"
_SIDED_TEXT = re.compile(r"(?<![\w.])(chamber |[pVA]_?|V_\{0|p_\{)([12])(?!\d|\.\d)")
_FROM_THE_OTHER_END = {"x = 0": "x = stroke", "A_1 x": "A_1 (L - x)"}
_SPLIT_PORTS = ("flow_delay", "hose_bore")  # of both sides; each has a port of its own as well
_SIDED_PORT = re.compile(r"(leak|volume|read_p|unread_p)(_?)([12])(_ambient)?")


def variants(effect: Effect) -> list[Effect]:
    """Return the variants of an effect at either side.

    Args:
        effect: An effect as it is declared.

    Returns:
        Both sides where it is declared for both chambers, the other side where it is declared for one, else none.

    >>> from pneucli.physics.effects import catalogue
    >>> [variant.name for variant in variants(catalogue()["chamber-leak"])]
    ['chamber-leak:2']
    """
    sides = {side for port in effect.ports for side in _sides_of(port)}
    if not sides or not all(_sides_of(port) for port in effect.ports):
        return []
    wanted: tuple[Chamber, ...] = (1, 2) if sides == {1, 2} else (2,)
    return [_on_side(effect, chamber) for chamber in wanted]


def with_variants(effects: Iterable[Effect]) -> dict[str, Effect]:
    """Return effects together with their variants.

    Args:
        effects: Effects as they are declared; one with the name of a variant replaces the variant.

    Returns:
        Effects by name.

    >>> from pneucli.physics.effects import catalogue
    >>> sorted(with_variants([catalogue()["chamber-leak"]]))
    ['chamber-leak', 'chamber-leak:2']
    """
    declared = list(effects)
    found = {variant.name: variant for effect in declared for variant in variants(effect)}
    return found | {effect.name: effect for effect in declared}


def declared_name(name: str) -> str:
    """Return the name under which an effect is declared.

    Args:
        name: Name of an effect or of a variant.

    Returns:
        The name without its side.

    >>> declared_name("chamber-leak:2")
    'chamber-leak'
    """
    return name.partition(SEPARATOR)[0]


def _sides_of(port: str) -> set[int]:
    """Return the chambers at which a port stands; none for one that has no side."""
    if port in _SPLIT_PORTS:
        return {1, 2}
    parts = _SIDED_PORT.fullmatch(port)
    return {int(parts[3])} if parts else set()


def _on_side(effect: Effect, chamber: Chamber) -> Effect:
    both = {side for port in effect.ports for side in _sides_of(port)} == {1, 2}
    split = any(port in _SPLIT_PORTS for port in effect.ports)
    selected = {p: f for p, f in effect.ports.items() if not both or chamber in _sides_of(p)}
    ports = {_port_of(port, chamber, mirrored=not both): f for port, f in selected.items()}
    return replace(
        effect,
        name=f"{effect.name}{SEPARATOR}{chamber}",
        title=_title_of(effect.title, chamber, both=both, split=split),
        part=_part_of(effect.part, chamber),
        ports=ports,
        equation=effect.equation if both else _mirrored_text(effect.equation),
        looks_like=effect.looks_like if both else _mirrored_text(effect.looks_like),
        shows_over=effect.shows_over if both else _mirrored_text(effect.shows_over),
        separate=effect.separate if both else _mirrored_text(effect.separate),
        needs=frozenset({"p1", "p2"}) if both and not split else frozenset(),
        side=chamber,
    )


def _title_of(title: str, chamber: Chamber, *, both: bool, split: bool) -> str:
    if split:
        return f"{title} {chamber}"
    return f"{title}: p{chamber} alone" if both else _mirrored_text(title)


def _part_of(part: Part, chamber: Chamber) -> Part:
    """Return the part of a variant: a hose shows its side only where a valve fills the other one as well."""
    if part == "line":
        return "line 2"
    return "chamber 2" if chamber == 2 and part == "chamber" else part


def _port_of(port: str, chamber: Chamber, *, mirrored: bool) -> str:
    if port in _SPLIT_PORTS:
        return f"{port}_{chamber}"
    return _mirrored(port) if chamber == 2 and mirrored else port


def _mirrored(port: str) -> str:
    """Return the port of the other chamber.

    >>> _mirrored("leak_1_ambient"), _mirrored("unread_p2")
    ('leak_2_ambient', 'unread_p1')

    """
    found = _SIDED_PORT.sub(lambda m: f"{m[1]}{m[2]}{3 - int(m[3])}{m[4] or ''}", port)
    assert found in PORTS
    return found


def _mirrored_text(text: str) -> str:
    """Return text about one chamber as text about the other.

    >>> _mirrored_text("Offset of the sensor of p1"), _mirrored_text("$V_1 = V_{01} + A_1 x$")
    ('Offset of the sensor of p2', '$V_2 = V_{02} + A_2 (L - x)$')

    """
    for phrase, other in _FROM_THE_OTHER_END.items():
        text = text.replace(phrase, other)
    return _SIDED_TEXT.sub(lambda m: f"{m[1]}{3 - int(m[2])}", text)
