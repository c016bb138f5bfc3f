"""One checked recording in SI units, as every domain package receives it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from pneucli.arrangements import ARRANGEMENTS, Arrangement
from pneucli.arrangements import ArrangementName as ArrangementName
from pneucli.experiments import EXPERIMENT_KINDS, ExperimentKind
from pneucli.experiments import ExperimentName as Experiment

if TYPE_CHECKING:  # who only reads the pipeline file need not wait for scipy
    from pneucli.noise import NoiseModel

Array = NDArray[np.float64]
Use = Literal["train", "test"]


@dataclass(frozen=True)
class Recording:
    """Signals of one recording over strictly increasing time stamps (s), which need not be equidistant.

    ``signals`` maps names of :mod:`pneucli.quantities` (without ``time``) to arrays of shape ``(n,)`` in SI units,
    pressures absolute; NaN marks a sample that was not measured. ``noise`` holds one model per signal.
    ``chamber_2``: ``closed`` (air spring), ``open`` (to ambient) or ``valve`` (as the rig's valves are arranged).
    ``chamber``: of a valve test, the chamber whose valve fills the vessel.
    ``imposed = "motion"``: the motion is taken as given and the force is compared. ``valve_shut``: no flow through it.
    """

    name: str
    experiment: Experiment
    use: Use
    time: Array
    signals: Mapping[str, Array]
    noise: Mapping[str, NoiseModel] = field(default_factory=dict)
    chamber_2: Literal["closed", "open", "valve"] | None = None
    imposed: Literal["motion"] | None = None
    valve_shut: bool = False
    chamber: Literal[1, 2] = 1

    @property
    def kind(self) -> ExperimentKind:
        """What its kind of experiment means."""
        return EXPERIMENT_KINDS[self.experiment]

    @property
    def period(self) -> float:
        """Median sampling period in s."""
        return float(np.median(np.diff(self.time)))

    def __contains__(self, signal: str) -> bool:
        return signal in self.signals

    def __getitem__(self, signal: str) -> Array:
        return self.signals[signal]


@dataclass(frozen=True)
class ParameterPrior:
    """What is known of a parameter before it is identified, in its unit: ``fixed``, or its start, its bounds, and the
    standard deviation ``sigma`` of what is known of its ``start``; None where it is not known.
    """

    unit: str
    fixed: float | None = None
    start: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    sigma: float = math.inf


@dataclass(frozen=True)
class Rig:
    """What is known of the rig, SI; ``None`` where the pipeline file leaves it out (then it is identified).

    Areas in m^2, volumes in m^3, stroke in m, mass in kg, pressures absolute in Pa, temperature in K,
    ``gas_constant`` in J/(kg K); ``valve_null``, the command in V at which nothing flows, to be identified where it is
    ``null_free``, then with the ``null_range`` in which it lies, and ``null_ranges``, those that recordings which fill
    and vent show by themselves. ``polytropic_exponent`` of the gas in a chamber: None is that of an adiabatic one;
    to be identified where it is ``exponent_free``. ``priors``: what is known beforehand of parameters by name.
    """

    gas_temperature: float = 293.15
    ambient_pressure: float = 101_325.0
    supply_pressure: float | None = None
    heat_capacity_ratio: float = 1.4
    gas_constant: float = 287.0
    polytropic_exponent: float | None = None
    exponent_free: bool = False
    vessel_volume: float | None = None
    piston_area_1: float | None = None
    piston_area_2: float | None = None
    stroke: float | None = None
    dead_volume_1: float | None = None
    dead_volume_2: float | None = None
    moving_mass: float | None = None
    valve_null: float = 0.0
    null_free: bool = False
    null_range: tuple[float, float] | None = None
    null_ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    valve_arrangement: ArrangementName = "one-chamber"
    valve_kind: Literal["proportional", "switching"] = "proportional"
    priors: Mapping[str, ParameterPrior] = field(default_factory=dict)

    @property
    def arrangement(self) -> Arrangement:
        """How the valves are connected to the chambers."""
        return ARRANGEMENTS[self.valve_arrangement]

    def command_sign(self, chamber: Literal[1, 2]) -> float:
        """Return 1 where a larger command fills a chamber, or the vessel on its port; -1 where it vents it."""
        return -1.0 if chamber == 2 and self.arrangement.chamber_2 == "mirrored" else 1.0

    @property
    def has_cylinder(self) -> bool:
        """Whether the pipeline describes a cylinder at all."""
        return self.piston_area_1 is not None

    @property
    def piston_areas(self) -> tuple[float, float]:
        """Areas in m^2 on which p1 and p2 act: 0 where there is no piston, equal where only one is given."""
        area_1 = self.piston_area_1 or 0.0
        return area_1, area_1 if self.piston_area_2 is None else self.piston_area_2
