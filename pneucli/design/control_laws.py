"""Synthesis of the control laws, each by its own file, from the data of an axis."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller, nominal_load
from pneucli.design.air_spring import max_motion_gradient
from pneucli.design.bandwidths import Bandwidths, loop_gains, low_pass_share
from pneucli.design.pdc import Pdc, WeightStudy
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import (
    LinearSystem,
    SlidingSector,
    eta_for_slope,
    sector_from_eta,
    surface_by_lq,
    surface_by_poles,
)
from pneucli.errors import InputError
from pneucli.messages.design import SlidingLine
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

    @property
    def max_motion_gradient(self) -> float:
        """Largest pressure gradient in Pa/s that the piston's motion makes: the a32 term."""
        return max_motion_gradient(self.cascade.values)

    @property
    def sector(self) -> SlidingSector:
        """The sliding sector of ``[design] eta``; raises InputError where the model has no dry friction."""
        return designed_sector(self.cascade, self.bandwidths, self.requirements)

    def low_pass_share(self, corner: float) -> float:
        """Return the share by which a low-pass of that corner (rad/s) follows in one sample."""
        return low_pass_share(corner, self.requirements.period)

    def shared_parameters(self, *, feedforward: bool = False) -> dict[str, float]:
        """Return the parameters that the laws of the thesis share: loop gains, speed filter, no parts of ``best``.

        Args:
            feedforward: Whether mass, friction and motion are fed forward.
        """
        off = dict.fromkeys(("C_DISTURBANCE_OBSERVERS", "C_HOLD", "C_SWITCHING", "C_FRICTION_LEAD"), 0.0)
        return {
            **loop_gains(self.bandwidths, self.requirements),
            **off,
            "C_FEEDFORWARD": float(feedforward),
            "C_SPEED_FILTER": self.low_pass_share(self.bandwidths.motion_observer),
        }

    def load_observer_parameters(self, *, friction: bool) -> dict[str, float]:
        """Return the load observer: M_k is the switching force in N, the low-pass has the corner of the position loop.

        Args:
            friction: Whether the observer's model has the friction a22(v).

        References:
            Thesis (5.20), (5.21), (7.5), (7.6).
        """
        return {
            "C_LOAD_STEP_MAX": self.switching_force,
            "C_LOAD_FILTER": self.low_pass_share(self.bandwidths.position),
            "C_FRICTION_OBSERVED": float(friction),
        }

    def reason_missing(self, name: str) -> str:
        """Return the reason why the field ``name`` is empty."""
        return (self.missing or {}).get(name, "not known")


def designed_sector(cascade: Controller, bandwidths: Bandwidths, requirements: Requirements) -> SlidingSector:
    """Return the sector of ``[design] eta``; by default its steeper line is the corner of the position loop.

    Args:
        cascade: The controller ``best``, for mass and friction.
        bandwidths: Corner frequencies in rad/s.
        requirements: ``eta`` in s/m, ``sector_ratio``, ``period`` in s.

    Raises:
        InputError: The model has no dry friction.

    References:
        Thesis (6.18) to (6.20), (6.22).
    """
    c, width = cascade.values, requirements.sector_ratio
    eta = requirements.eta or eta_for_slope(bandwidths.position, c["C_MASS"], c["C_STATIC"], width)
    if c["C_STATIC"] <= 0.0:
        raise InputError(
            "the sliding sector", "the model has no dry friction", "friction that depends on speed", code="E070"
        )
    return sector_from_eta(eta, c["C_MASS"], requirements.period, c["C_STATIC"], c["C_VISCOUS"], width)


def sliding_surfaces(mechanical: LinearSystem, bandwidths: Bandwidths, requirements: Requirements) -> list[SlidingLine]:
    """Design the sliding line of the mechanical subsystem by pole placement and by LQ.

    Args:
        mechanical: Piston with states position (m) and speed (m/s), input force (N).
        bandwidths: Corner frequencies (rad/s); the pole is that of the position loop.
        requirements: ``surface`` selects the method, ``surface_weights`` weight the squared error (1/m^2) and the
            squared rate (s^2/m^2). Without weights, the error of one time constant of the position loop weighs as much
            as its rate.

    Returns:
        One line a method: ``surface`` (2,), ``pole`` and ``slope`` (1/s), and ``taken`` for the selected one.

    References:
        Thesis (5.2); Utkin and Young (1978) for the LQ surface.

    """
    weights = requirements.surface_weights or (bandwidths.position**2, 1.0)
    found = {
        "poles": surface_by_poles(mechanical.A, mechanical.B, [-bandwidths.position]),
        "lq": surface_by_lq(mechanical.A, mechanical.B, np.diag(weights)),
    }
    return [
        SlidingLine(
            "mechanical",
            METHODS[kind],
            surface=[float(v) for v in one.S[0]],
            pole=float(one.poles[0].real),
            slope=float(one.S[0][0] / one.S[0][1]),
            taken=kind == requirements.surface,
        )
        for kind, one in found.items()
    ]


def collect_design_data(
    cascade: Controller,
    bandwidths: Bandwidths,
    requirements: Requirements,
    surfaces: Sequence[SlidingLine],
    weights: Sequence[WeightStudy],
    missing: Mapping[str, str],
) -> DesignData:
    """Collect the data of all laws; of the verified PDCs, the one with the fastest decay is selected.

    Args:
        cascade: Controller ``best``.
        bandwidths: Corner frequencies of loops without prediction (rad/s).
        requirements: The table ``[design]``.
        surfaces: The lines of :func:`sliding_surfaces`.
        weights: Studies of the weight types, :func:`pneucli.design.pdc.compare_weight_types`.
        missing: Reasons for empty fields.

    """
    slope = next(line.slope for line in surfaces if line.taken)
    verified = [(w.model, w.pdc) for w in weights if w.model is not None and w.pdc is not None and w.pdc.verified]
    fastest = max(verified, key=lambda pair: pair[1].rate, default=None)
    return DesignData(cascade, requirements, bandwidths, slope, fastest, missing)


def controller_for(law: str, data: DesignData) -> Controller:
    """Design the controller of one law.

    Args:
        law: A key of ``LAWS``.
        data: The design data of the axis.

    Raises:
        InputError: The data lack what the law needs, or there is no such law.

    """
    found = LAWS[law].design(data)
    common = {n: v for n, v in found.items() if n in layout.PARAMETERS and not isinstance(v, tuple)}
    own = np.concatenate([[], *(np.atleast_1d(found[name]) for name in LAWS[law].parameters)])
    assert set(found) == {*common, *LAWS[law].parameters}
    return data.cascade.with_law(law, common, tuple(map(float, own)))


def design_controllers(
    data: DesignData, names: Iterable[str] = tuple(LAWS)
) -> tuple[dict[str, Controller], dict[str, str]]:
    """Design several laws.

    Returns:
        The controllers by name of the law, and for each law that cannot be designed the reason.

    """
    made, failed = {}, {}
    for name in names:
        try:
            made[name] = controller_for(name, data)
        except InputError as error:
            failed[name] = f"{error.where}: {error.found}"
    return made, failed


def design_variants(data: DesignData, names: Iterable[str]) -> dict[str, Controller]:
    """Design the variants of the given laws that the requirements do not select, for comparison.

    Returns:
        Controllers by the name of the variant, such as ``relay, switching``.

    """
    found: dict[str, Controller] = {}
    for name in names:
        for title, choice in LAWS[name].variants.items():
            changed = replace(data.requirements, **choice)
            if changed != data.requirements:
                made, _ = design_controllers(replace(data, requirements=changed), [name])
                found |= {f"{name}, {title}": controller for controller in made.values()}
    return found
