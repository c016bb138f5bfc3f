"""A supply that sags: its pressure falls by a quarter while gas flows, which a regulator of the right size prevents."""

from collections.abc import Iterator

import numpy as np

from pneucli.plausibility.detectors import Detector
from pneucli.plausibility.rig_check import Finding, RigCheck, excess

MAX_FALL = 0.25  # of the supply pressure above ambient


def _find(rig_check: RigCheck) -> Iterator[Finding]:
    for one in rig_check.recordings:
        if "p_supply" in one:
            gauge = one["p_supply"] - rig_check.rig.ambient_pressure
            fall = 1.0 - float(np.nanmin(gauge) / np.nanmax(gauge))
            noise = one.noise["p_supply"].rms if "p_supply" in one.noise else 0.0
            found, mend = (
                f"the supply falls by {100 * fall:.0f} %",
                "use a larger regulator, or a vessel before the valve",
            )
            by = excess(fall - MAX_FALL, noise / float(np.nanmax(gauge)))
            yield from Finding("supply-sag", "p_supply", one.name, found, mend, by).judged()


SUPPLY_SAG = Detector(_find, {"supply-sag": ("", "the supply falls by more than a quarter")})
