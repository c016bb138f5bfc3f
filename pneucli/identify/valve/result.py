"""The result of a valve identification: map, inverse, curves, characteristics and lack of fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.guesses.base_model import PLACEHOLDER_VOLUME
from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import CommandConversion
from pneucli.identify.valve.area_model import AreaModel
from pneucli.identify.valve.fit import Posterior
from pneucli.identify.valve.iso6358 import IsoConductance
from pneucli.identify.valve.lack_of_fit import LackOfFit
from pneucli.identify.valve.maps import Coverage, GradientMap, InverseMap, invert_gradient
from pneucli.identify.valve.uncertainty import Budget
from pneucli.simulate.model import Model

MAX_GRADIENT_RATIO = 3.0  # times the steepest measured slope: a steeper map does not describe this valve


@dataclass(frozen=True)
class Curve:
    """One transient at a constant command: measured and fitted p (Pa) over time (s), and dp/dt (Pa/s) along the fit."""

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
    """Rms residual of a recording's transients over the noise, with their initial pressures fitted."""

    recording: str
    use: str
    ratio_to_noise: float


@dataclass(frozen=True)
class ValveIdentification:
    """The identified paths of one chamber, and the lack of fit of the model to them.

    ``map`` and ``inverse`` are ``measured`` in a vessel, and ``lack_of_fit`` is the difference of the model from them;
    else they are the model's own, from its fit to a driven piston. ``iso`` are the model's characteristics.
    ``residuals`` cover all recordings, held-out ones included. ``max_gradient`` is the largest |dp/dt| (Pa/s) of the
    map where data cover it, ``max_measured_gradient`` the largest in the recordings. Commands are those of the valve;
    ``area_model`` and ``lack_of_fit`` count from the null.
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
    area_model: AreaModel
    posterior: Posterior
    resampled: tuple[tuple[str, float], ...] = ()  # recordings that were resampled, and the error of p1 in Pa
    budgets: tuple[Budget, ...] = ()  # of its characteristics

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
        return self.area_model.model_gradient.valve.label

    @property
    def volume(self) -> float | None:
        """The volume in m^3 for which the gradients hold, None for a vessel of unknown volume."""
        model = self.area_model.model_gradient.model
        return known_vessel_volume(model)

    def gradient(self, u: Array, p: Array, supply: Array | float | None = None) -> Array:
        """Return dp/dt (Pa/s) at any ``u`` (V), ``p`` and ``supply`` (Pa), broadcast against each other."""
        supply = self.area_model.supply if supply is None else supply
        opening = self.command_conversion.to_opening(u)
        return self.area_model.gradient(
            self.posterior.theta, *np.broadcast_arrays(opening, p, np.asarray(supply, dtype=np.float64))
        )

    def command(self, gradient: Array, p: Array) -> tuple[Array, Mask]:
        """Return the command (V) for ``gradient`` (Pa/s) at ``p`` (Pa), and whether it is reachable."""
        gradient, p = np.broadcast_arrays(gradient, p)
        opening, reachable = invert_gradient(self.area_model, self.posterior, gradient, p, self.coverage)
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
