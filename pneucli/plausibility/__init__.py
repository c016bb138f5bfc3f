"""Whether recordings and the stated rig can be true together: looked at before anything is fitted.

Every limit stands where it is used, and lies beyond what an effect of the catalogue may explain: an offset, a scale of
some per cent, a leak, a lag, an extra mass.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from pneucli.plausibility import flow, forces, motion, readings, response, samples
from pneucli.plausibility.bench import Bench
from pneucli.plausibility.finding import Finding, in_words
from pneucli.plausibility.looks import Look, look, looks_table
from pneucli.recording import Recording, Rig

__all__ = ["Finding", "Look", "findings", "in_words", "look", "looks_table"]

CHECKS = (samples, readings, response, motion, forces, flow)


def findings(
    recordings: Sequence[Recording], rig: Rig, horizon: float, stated: Mapping[str, Collection[str]]
) -> list[Finding]:
    """Return what cannot be true, by check and in the recordings' order.

    ``horizon`` (s) is the interval at which the model is restarted; ``stated`` names, by recording, the signals that
    the pipeline file states as held.
    """
    bench = Bench(recordings, rig, horizon, stated)
    return [finding for module in CHECKS for finding in module.check(bench)]
