"""Synthesis of the control laws: from an identified axis and its requirements to the parameters of each law.

The samples of the laws stand in :mod:`pneucli.controller.laws`. A law is one module there and one entry in ``LAWS``
and in ``SYNTHESIS``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.air_spring import max_motion_gradient
from pneucli.design.bandwidths import Bandwidths
from pneucli.design.design_data import DesignData
from pneucli.design.gains import loop_gains
from pneucli.design.requirements import Requirements
from pneucli.design.sliding_sector import SlidingSector, eta_for_slope, sector_from_eta
from pneucli.errors import InputError

LawParameters = Mapping[str, "float | tuple[float, ...]"]


def controller_for(law: str, data: DesignData) -> Controller:
    """Design the controller of one law.

    Args:
        law: A key of ``LAWS``.
        data: The design data of the axis.

    Raises:
        InputError: The data lack what the law needs, or there is no such law.

    """
    found = SYNTHESIS[law](data)
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
        for title, choice in VARIANTS.get(name, {}).items():
            changed = replace(data.requirements, **choice)
            if changed != data.requirements:
                made, _ = design_controllers(replace(data, requirements=changed), [name])
                found |= {f"{name}, {title}": controller for controller in made.values()}
    return found


def cascade_parameters(data: DesignData) -> LawParameters:
    """Return no parameters: the law ``best`` is the cascade itself."""
    return {}


def shared_parameters(data: DesignData, *, feedforward: bool = False) -> dict[str, float]:
    """Return the parameters that the laws of the thesis share: loop gains, speed filter, no parts of ``best``.

    Args:
        data: What the laws are designed from.
        feedforward: Whether mass, friction and motion are fed forward.
    """
    h = data.requirements.period
    off = dict.fromkeys(("C_DISTURBANCE_OBSERVERS", "C_HOLD", "C_SWITCHING", "C_FRICTION_LEAD"), 0.0)
    return {
        **loop_gains(data.bandwidths, data.requirements),
        **off,
        "C_FEEDFORWARD": float(feedforward),
        "C_SPEED_FILTER": low_pass_share(data.bandwidths.motion_observer, h),
    }


def low_pass_share(corner: float, period: float) -> float:
    """Return the share by which a sampled first-order low-pass approaches its input in one sample.

    Args:
        corner: Corner frequency in rad/s.
        period: Sample time in s.

    >>> round(low_pass_share(100.0, 1e-3), 6)
    0.095163

    """
    return 1.0 - math.exp(-corner * period)


def relay_parameters(data: DesignData) -> LawParameters:
    """Return amplitude (N), slope (1/s) and switches of the relay.

    References:
        Thesis (5.6): relay; (5.9): equivalent control; (5.10): both.
    """
    return shared_parameters(data) | {
        "C_RELAY_FORCE": data.switching_force,
        "C_RELAY_SLOPE": data.surface_slope,
        "C_RELAY_EQUIVALENT": float(data.requirements.equivalent_control),
        "C_RELAY_IMPLICIT": float(data.requirements.relay == "implicit"),
    }


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


def load_observer_parameters(data: DesignData, *, friction: bool) -> dict[str, float]:
    """Return the load observer: M_k is the switching force in N, the low-pass has the corner of the position loop.

    Args:
        data: What the laws are designed from.
        friction: Whether the observer's model has the friction a22(v).

    References:
        Thesis (5.20), (5.21), (7.5), (7.6).
    """
    return {
        "C_LOAD_STEP_MAX": data.switching_force,
        "C_LOAD_FILTER": low_pass_share(data.bandwidths.position, data.requirements.period),
        "C_FRICTION_OBSERVED": float(friction),
    }


def sector_parameters(data: DesignData) -> LawParameters:
    """Return the parameters of sector and load observer: M in N, slopes and the smaller vertex in 1/s.

    Raises:
        InputError: The model has no dry friction.

    References:
        Thesis (5.11) to (5.14), (6.18) to (6.20), (7.5), (7.6).
    """
    sector = designed_sector(data.cascade, data.bandwidths, data.requirements)
    own = {
        "C_SECTOR_FORCE": data.switching_force,
        "C_LAMBDA_1": sector.lambda_1,
        "C_LAMBDA_2": sector.lambda_2,
        "C_VERTEX_1": sector.a_1,
    }
    return shared_parameters(data) | load_observer_parameters(data, friction=True) | own


def compensated_parameters(data: DesignData) -> LawParameters:
    """Return both disturbance observers; M_k of the flow is the largest a32 term in Pa/s.

    References:
        Thesis (5.20), (5.21): model reference adaptive compensation in discrete time.
    """
    own = {
        "C_FLOW_STEP_MAX": max_motion_gradient(data.cascade.values),
        "C_FLOW_FILTER": low_pass_share(data.bandwidths.flow_observer, data.requirements.period),
    }
    observer = load_observer_parameters(data, friction=data.requirements.friction_in_observer)
    return shared_parameters(data) | observer | own


def pdc_parameters(data: DesignData) -> LawParameters:
    """Return weights and gains of the parallel distributed compensation.

    Raises:
        InputError: No weight type has verified gains.
    """
    if data.scheduled is None:
        raise InputError("the PDC", data.reason_missing("scheduled"), "gains that the LMIs allow", code="E070")
    model, pdc = data.scheduled
    speed_weights, position_weights = model.weights
    table = np.concatenate([speed_weights.ravel(), position_weights.ravel(), pdc.gains.ravel()])
    return {
        **shared_parameters(data),
        "C_PDC_SPEEDS": float(speed_weights.shape[0]),
        "C_PDC_V_WEIGHTS": float(speed_weights.shape[1]),
        "C_PDC_POSITIONS": float(position_weights.shape[0]),
        "C_PDC_FIRST": float(model.grids[1][0]),
        "C_PDC_LAST": float(model.grids[1][-1]),
        "C_PDC_X_WEIGHTS": float(position_weights.shape[1]),
        "C_PDC_TABLE": tuple(map(float, table)),
    }


# choices of a law by the keys of ``[design]``
VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "relay": {"implicit": {"relay": "implicit"}, "switching": {"relay": "switching"}},
    "compensated": {
        "friction in the observer": {"friction_in_observer": True},
        "friction compensated": {"friction_in_observer": False},
    },
}

SYNTHESIS: dict[str, Callable[[DesignData], LawParameters]] = {
    "best": cascade_parameters,
    "pid": shared_parameters,
    "pid-feedforward": partial(shared_parameters, feedforward=True),
    "relay": relay_parameters,
    "sector": sector_parameters,
    "compensated": compensated_parameters,
    "pdc": pdc_parameters,
}
