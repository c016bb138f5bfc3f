"""What all checks look at: the recordings, and what the pipeline file states of the rig."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pneucli.plausibility.signal_activity import is_inactive
from pneucli.quantities import display_unit
from pneucli.recording import Recording, Rig
from pneucli.units import parse_unit

Array = NDArray[np.float64]

# the middle between "as stated" and "wrong by a power of ten", such as mm for cm: no effect of the catalogue changes a
# quantity this much but an extra mass
UNIT_SLIP_FACTOR = float(np.sqrt(10.0))
# the middle between "right" and "off by ambient pressure", over ambient pressure
AMBIENT_SLIP_SHARE = 0.5
# standard errors from the jackknife of ten stretches: Student's t with 9 degrees of freedom exceeds them in 1 of 5,000
T_QUANTILE = 6.0
# times a sensor's noise, that a change must have to be no noise: two samples of white noise differ by 8 at most
MIN_SIGNAL_TO_NOISE = 10.0
# of the moving time, that each direction must have to tell friction from a constant force
MIN_DIRECTION_SHARE = 0.1


@dataclass(frozen=True)
class RigCheck:
    """Recordings in SI, the rig, and by recording the names of the signals that the file states as held."""

    recordings: Sequence[Recording]
    rig: Rig
    stated: Mapping[str, Collection[str]]

    def is_inactive(self, recording: Recording, signal: str) -> bool:
        """Whether a signal of a recording is constant or nothing but noise."""
        key = (recording.name, signal)
        if key not in self._rests:
            self._rests[key] = is_inactive(recording[signal])
        return self._rests[key]

    def active_signals(self, recording: Recording, *signals: str) -> list[str]:
        """Return those of ``signals`` that a recording has and that do something in it."""
        return [name for name in signals if name in recording and not self.is_inactive(recording, name)]

    def volume(self, chamber: int, x: Array) -> Array | None:
        """Return a chamber's volume in m^3 at positions x in m; None where the file does not say it."""
        rig = self.rig
        area = rig.piston_areas[chamber - 1]
        if not rig.has_cylinder:
            return None
        if chamber == 1:
            return None if rig.dead_volume_1 is None else rig.dead_volume_1 + area * x
        if rig.dead_volume_2 is None or rig.stroke is None:
            return None
        return np.asarray(rig.dead_volume_2 + area * (rig.stroke - x))

    def net_force(self, recording: Recording, signals: Mapping[str, Array]) -> Array | None:
        """Return the force in N that drives the piston, from ``signals`` of any one shape; None where none is known."""
        known = {name for name in ("p1", "p2") if name in recording and self.rig.has_cylinder}
        parts = [signals["force"]] if "force" in recording else []
        areas = dict(zip(("p1", "p2"), (self.rig.piston_areas[0], -self.rig.piston_areas[1]), strict=True))
        parts += [areas[name] * (signals[name] - self.rig.ambient_pressure) for name in sorted(known)]
        return np.asarray(sum(parts)) if parts else None

    @cached_property
    def _rests(self) -> dict[tuple[str, str], bool]:
        return {}


@dataclass(frozen=True)
class Finding:
    """``found`` is the evidence with its numbers, ``mend`` the edit of the pipeline file that would mend it."""

    check: str
    signal: str
    recording: str
    found: str
    mend: str


def format_in_display_unit(value: float, signal: str, digits: int = 3) -> str:
    """Return a value (SI) of a signal in the unit that people read it in, such as ``"1.01 bar"``."""
    unit = display_unit(signal)
    return f"{format_number(value / parse_unit(unit).factor, digits)} {unit}"


def format_number(value: float, digits: int = 3) -> str:
    """Return a number as people write it: to a thousandth at most, and without an exponent up to a million."""
    rounded = float(f"{value:.{digits}g}")
    if abs(rounded) < 1e-3:
        return f"{abs(rounded):.3f}"
    return f"{rounded:.0f}" if 10.0**digits <= abs(rounded) < 1e6 else f"{rounded:.{digits}g}"
