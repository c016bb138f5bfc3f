"""The result of a valve identification: map, inverse, curves, characteristics and lack of fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import CommandConversion
from pneucli.identify.valve.iso6358 import IsoConductance
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.maps import Coverage, GradientMap, InverseMap, invert_gradient
from pneucli.identify.valve.model_gradient import ModelGradient
from pneucli.messages.identify import Budget
from pneucli.simulate.model import Model

MAX_GRADIENT_RATIO = 3.0  # times the steepest measured slope: a steeper map does not describe this valve


@dataclass(frozen=True)
class Curve:
    """A held command: measured and fitted p (Pa) over time (s), and the model's dp/dt (Pa/s) along the fitted one."""

    recording: str
    u: float
    time: Array
    measured: Array
    fitted: Array
    gradient: Array
    ci_low: Array
    ci_high: Array


@dataclass(frozen=True)
class RecordingResidual:
    """Rms residual of the model in a recording over the noise, whitened for the errors of initial pressures."""

    recording: str
    use: str
    ratio_to_noise: float


@dataclass(frozen=True)
class ValveIdentification:
    """The paths of one chamber of the fitted model, and how far measured gradients are off.

    ``measured``: the curves are those of a vessel, else of a driven piston. ``residuals`` cover all valve tests,
    held-out ones included. ``max_gradient`` is the largest |dp/dt| (Pa/s) of the map where data cover it,
    ``max_measured_gradient`` the largest in the recordings. Commands are those of the valve; ``model_gradient`` and
    ``lack_of_fit`` count from the null.
    """

    chamber: Chamber
    command_conversion: CommandConversion
    measured: bool
    curves: tuple[Curve, ...]
    map: GradientMap
    inverse: InverseMap
    lack_of_fit: LackOfFit
    iso: tuple[IsoConductance, ...]
    residuals: tuple[RecordingResidual, ...]
    max_gradient: float
    max_measured_gradient: float
    coverage: Coverage
    model_gradient: ModelGradient
    budgets: Mapping[str, Budget] = field(default_factory=dict)  # of its characteristics

    @property
    def is_consistent(self) -> bool:
        """Whether the map stays close to the slopes of the curves."""
        return self.max_gradient <= MAX_GRADIENT_RATIO * self.max_measured_gradient

    def residual_to_noise(self, use: str) -> float | None:
        """Return the rms residual over the noise of all recordings of one use, None without any."""
        ratios = [one.ratio_to_noise for one in self.residuals if one.use == use]
        return float(np.sqrt(np.mean(np.square(ratios)))) if ratios else None

    @property
    def label(self) -> str:
        """The prefix of its parameter names."""
        return self.model_gradient.valve.label

    @property
    def volume(self) -> float | None:
        """The volume in m^3 for which the gradients hold, None for a vessel of unknown volume."""
        model = self.model_gradient.model
        return known_vessel_volume(model)

    def gradient(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return dp/dt (Pa/s) at any ``u`` (V), ``p`` and ``supply`` (Pa), broadcast against each other."""
        supply = self.model_gradient.supply if supply is None else supply
        opening = self.command_conversion.to_opening(u)
        return self.model_gradient(*np.broadcast_arrays(opening, p, np.asarray(supply, dtype=np.float64)))

    def command(self, gradient: Array, p: Array) -> tuple[Array, Mask]:
        """Return the command (V) for ``gradient`` (Pa/s) at ``p`` (Pa), and whether it is reachable."""
        gradient, p = np.broadcast_arrays(gradient, p)
        opening, reachable = invert_gradient(self.model_gradient, gradient, p, self.coverage)
        return self.command_conversion.from_opening(opening), reachable


def known_vessel_volume(model: Model) -> float | None:
    """Return the volume of the vessel.

    Args:
        model: The fitted model.

    Returns:
        The stated or identified volume in m^3; None where it is unknown.

    """
    volume = model.values["rig.vessel_volume"]
    return None if model.rig.vessel_volume is None and volume == PLACEHOLDER_VOLUME else volume
