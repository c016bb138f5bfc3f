"""What of the rig the recordings ask for and nothing can stand in for, and what is taken for granted instead."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pneucli.messages.identify import Assumption
from pneucli.recording import Recording, Rig

MAX_NAMED_RECORDINGS = 3  # recordings that are named


@dataclass(frozen=True)
class RequiredInput:
    """One key of the pipeline file that is missing: where it belongs, what it is good for, and how it may be written.

    ``table`` is that of the key, such as ``rig.cylinder``; ``wanted`` names what the key is and the recordings.
    """

    table: str
    key: str
    wanted: str
    example: str


AppliesTo = Callable[[Recording, Rig], bool]


def _pressures_act_on_piston(one: Recording, _: Rig) -> bool:
    """Whether pressures act on a piston."""
    return one.kind.cylinder and (one.kind.valve or "p1" in one or "p2" in one)


def _gas_enclosed_in_chamber_2(one: Recording, _: Rig) -> bool:
    """Whether gas is shut in behind the piston."""
    return one.kind.axis and one.chamber_2 != "open"


def _supply_unrecorded(one: Recording, rig: Rig) -> bool:
    """Whether a valve lets gas in, from a pressure that nobody recorded."""
    if not one.kind.valve or one.valve_shut or "p_supply" in one:
        return False
    if one.kind.steady:
        return True
    opened = [one[u] for u in ("u", "u2") if u in one]
    sense = rig.command_sign(one.chamber)
    both = one.kind.axis and one.chamber_2 == "valve"  # one of both is filled by either sign
    return any(np.nanmax(sense * (u - rig.valve_null)) > 0.0 or (both and np.ptp(u) > 0.0) for u in opened)


def _chamber_2_volume_unobserved(one: Recording, rig: Rig) -> bool:
    """Whether nothing but its volume tells how gas that is shut in behind the piston pushes."""
    return _gas_enclosed_in_chamber_2(one, rig) and "p2" not in one


def _chamber_1_volume_unobserved(one: Recording, _: Rig) -> bool:
    """Whether nothing but its volume tells how gas behind the valve pushes."""
    return one.kind.axis and "p1" not in one


_RIG_KEYS: tuple[tuple[str, str, str, AppliesTo], ...] = (
    ("piston_area_1", "the area on which p1 acts", '"8.04 cm^2"', _pressures_act_on_piston),
    ("stroke", "the stroke, without which chamber 2 has no volume", '"200 mm"', _gas_enclosed_in_chamber_2),
    ("dead_volume_1", "the volume of chamber 1, which p1 does not show", '"30 cm^3"', _chamber_1_volume_unobserved),
    ("dead_volume_2", "the volume of chamber 2, which p2 does not show", '"30 cm^3"', _chamber_2_volume_unobserved),
    ("supply_pressure", "the pressure before the valve, which is not recorded", '"7 bar"', _supply_unrecorded),
)


def required_inputs(recordings: Sequence[Recording], rig: Rig) -> list[RequiredInput]:
    """Return what the recordings need of the rig and the pipeline file does not say."""
    found = []
    for key, what, example, of in _RIG_KEYS:
        asking = [one for one in recordings if getattr(rig, key) is None and of(one, rig)]
        if asking:
            table = "rig" if key == "supply_pressure" else "rig.cylinder"
            found.append(RequiredInput(table, key, f"{what} ({_named(asking)})", example))
    passive = [one for one in recordings if one.kind.cylinder and not one.kind.valve and "p2" not in one]
    if unread := [one for one in passive if one.chamber_2 in ("closed", "valve")]:
        what = f"the pressure of chamber 2, which is not open to ambient ({_named(unread)})"
        found.append(RequiredInput("[recordings]", "p2", what, '"1.013 bar"'))
    return found


def without_pressure(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings of driven pistons that read the pressure of neither chamber."""
    return [one for one in recordings if one.kind.axis and not {"p1", "p2"} & one.signals.keys()]


def tells_valve_map(recordings: Sequence[Recording]) -> bool:
    """Whether a pressure was read that a valve changes, without which only one gain of the valve shows."""
    return any(one.kind.valve and not one.valve_shut and {"p1", "p2"} & one.signals.keys() for one in recordings)


def _named(recordings: Sequence[Recording]) -> str:
    names = [one.name for one in recordings]
    more = f" and {len(names) - MAX_NAMED_RECORDINGS} more" if len(names) > MAX_NAMED_RECORDINGS else ""
    return ", ".join(names[:MAX_NAMED_RECORDINGS]) + more


def assumptions(recordings: Sequence[Recording], rig: Rig) -> Iterator[Assumption]:
    """Yield what stands in for what the pipeline file leaves out of the rig and the recordings."""
    behind = [one for one in recordings if one.kind.cylinder and (one.kind.valve or "p2" in one)]
    if behind and rig.has_cylinder and rig.piston_area_2 is None:
        yield Assumption("piston_area_2 is piston_area_1: no rod in chamber 2", "rig.cylinder.piston_area_2")
    quiet = [one for one in recordings if one.kind.cylinder and "p1" in one and "p2" not in one]
    if opened := [one for one in quiet if one.chamber_2 is None]:
        yield Assumption(f"chamber 2 is at ambient pressure in {_named(opened)}", "p2 or chamber_2 in [[recordings]]")
    if shut := [one for one in quiet if one.kind.axis and one.chamber_2 != "open"]:
        yield Assumption(f"chamber 2 starts at ambient pressure in {_named(shut)}", "p2 in [signals]")
    if blind := without_pressure(recordings):
        yield Assumption(
            f"the pressures are the model's own in {_named(blind)}: motion tells friction, mass and the valve's area "
            "only in ratio to supply pressure x piston area as stated, and no leak at all",
            "p1 in [signals]",
        )
        if not tells_valve_map(recordings) and rig.valve_kind == "proportional":
            yield Assumption(
                "the valve has one gain for all commands, since no map shows without a pressure; an overlap or a dead "
                "band is an effect to add in [model] effects",
                "p1 in [signals]",
            )
    driven = [one for one in recordings if one.kind.axis and one.chamber_2 == "valve" and "u2" in one]
    if driven and "u2" not in rig.arrangement.commands:
        what = f"u alone drives both chambers in {_named(driven)}, and u2 is not used"
        yield Assumption(what, 'arrangement = "two" in [rig.valve]')


VolumeKey = Literal["rig.dead_volume_1", "rig.dead_volume_2", "rig.vessel_volume"]


def volumes_to_identify(recordings: Sequence[Recording], rig: Rig) -> tuple[VolumeKey, ...]:
    """Return the volumes that the recordings identify and that the pipeline file leaves out.

    A dead volume shows as the piston moves; a vessel's volume with a cylinder that the same valve drives. A vessel
    alone tells only ratios to its volume. A recorded flow into the vessel measures its volume, also where the file
    states one.
    """
    driven = [one for one in recordings if one.kind.axis]
    found: list[VolumeKey] = []
    if driven and rig.dead_volume_1 is None:
        found.append("rig.dead_volume_1")
    if rig.dead_volume_2 is None and any(_gas_enclosed_in_chamber_2(one, rig) and "p2" in one for one in driven):
        found.append("rig.dead_volume_2")
    vessels = [one for one in recordings if one.kind.vessel and not one.valve_shut]
    if vessels and (any("flow" in one for one in vessels) or (driven and rig.vessel_volume is None)):
        found.append("rig.vessel_volume")
    return tuple(found)
