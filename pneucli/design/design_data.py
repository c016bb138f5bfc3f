"""The data from which the control laws are designed: axis, requirements, bandwidths, sliding line, PDC."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.bandwidths import Bandwidths
from pneucli.design.lpv import WeightStudy
from pneucli.design.pdc import Pdc
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import LinearSystem, surface_by_lq, surface_by_poles
from pneucli.tp import TPModel

METHODS = {"poles": "pole placement", "lq": "LQ"}  # of finding a sliding surface, by the words of ``[design] surface``


@dataclass(frozen=True)
class DesignData:
    """The data from which every law is designed.

    Attributes:
        cascade: Controller ``best``; the other laws take its axis, its gains and its inverse map.
        requirements: The table ``[design]``.
        bandwidths: Corner frequencies of loops without prediction (rad/s).
        surface_slope: Slope lambda of the sliding line (1/s), thesis (5.2).
        scheduled: TP model of the axis and its verified PDC; None without one.
        missing: The reason why a field is empty, by the name of the field.

    """

    cascade: Controller
    requirements: Requirements
    bandwidths: Bandwidths
    surface_slope: float
    scheduled: tuple[TPModel, Pdc] | None = None
    missing: Mapping[str, str] | None = None

    @property
    def switching_force(self) -> float:
        """Amplitude M of the switching terms in N: ``switching_gain`` times breakaway force and nominal load."""
        c = self.cascade.values
        return self.requirements.switching_gain * (c["C_STATIC"] + nominal_load(c))

    def reason_missing(self, name: str) -> str:
        """Return the reason why the field ``name`` is empty."""
        return (self.missing or {}).get(name, "not known")


def sliding_surfaces(
    mechanical: LinearSystem, bandwidths: Bandwidths, requirements: Requirements
) -> list[dict[str, object]]:
    """Design the sliding line of the mechanical subsystem by pole placement and by LQ.

    Args:
        mechanical: Piston with states position (m) and speed (m/s), input force (N).
        bandwidths: Corner frequencies (rad/s); the pole is that of the position loop.
        requirements: ``surface`` selects the method, ``surface_weights`` weight the squared error (1/m^2) and the
            squared rate (s^2/m^2). Without weights, the error of one time constant of the position loop weighs as much
            as its rate.

    Returns:
        One row a method: ``surface`` (2,), ``pole`` and ``slope`` (1/s), and ``taken`` for the selected one.

    References:
        Thesis (5.2); Utkin and Young (1978) for the LQ surface.

    """
    weights = requirements.surface_weights or (bandwidths.position**2, 1.0)
    found = {
        "poles": surface_by_poles(mechanical.A, mechanical.B, [-bandwidths.position]),
        "lq": surface_by_lq(mechanical.A, mechanical.B, np.diag(weights)),
    }
    return [
        {
            "system": "mechanical",
            "method": METHODS[kind],
            "surface": [float(v) for v in one.S[0]],
            "pole": float(one.poles[0].real),
            "slope": float(one.S[0][0] / one.S[0][1]),
            "taken": kind == requirements.surface,
        }
        for kind, one in found.items()
    ]


def collect_design_data(
    cascade: Controller,
    bandwidths: Bandwidths,
    requirements: Requirements,
    surfaces: Sequence[Mapping[str, object]],
    weights: Sequence[WeightStudy],
    missing: Mapping[str, str],
) -> DesignData:
    """Collect the data of all laws; of the verified PDCs, the one with the fastest decay is selected.

    Args:
        cascade: Controller ``best``.
        bandwidths: Corner frequencies of loops without prediction (rad/s).
        requirements: The table ``[design]``.
        surfaces: Rows of :func:`sliding_surfaces`.
        weights: Studies of the weight types, :func:`pneucli.design.lpv.compare_weight_types`.
        missing: Reasons for empty fields.

    """
    slope = next(float(line["slope"]) for line in surfaces if line["taken"])  # type: ignore[arg-type]
    verified = [(w.model, w.pdc) for w in weights if w.model is not None and w.pdc is not None and w.pdc.verified]
    fastest = max(verified, key=lambda pair: pair[1].rate, default=None)
    return DesignData(cascade, requirements, bandwidths, slope, fastest, missing)
