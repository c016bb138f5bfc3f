"""A checked recording in SI units, and the rig, as every package of the domain receives them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from pneucli.arrangements import ARRANGEMENTS, Arrangement, ArrangementName
from pneucli.arrays import Array
from pneucli.experiments import EXPERIMENT_KINDS, ExperimentKind
from pneucli.experiments import ExperimentName as Experiment

if TYPE_CHECKING:  # reading the pipeline file alone does not import scipy
    from pneucli.noise import NoiseModel

Use = Literal["train", "test"]


@dataclass(frozen=True)
class Recording:
    """Signals of one recording.

    Attributes:
        name: Name of the recording.
        experiment: Kind of experiment.
        use: Whether it is for training or testing.
        time: Time stamps in s, strictly increasing, not necessarily equidistant, shape (n,).
        signals: Signals by names of :mod:`pneucli.quantities` without ``time``, SI, pressures absolute, each (n,); NaN
            where a sample is missing.
        noise: Noise of each signal.
        chamber_2: ``closed`` (air spring), ``open`` (to ambient) or ``valve`` (as the valves are arranged).
        imposed: ``motion``: the motion is an input and the force is compared.
        valve_shut: Whether no gas flows through the valve.
        chamber: In a valve test, the chamber whose valve fills the vessel.
        added_mass: Mass in kg that moved with the piston in this recording, in addition to the rig's.
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
    added_mass: float = 0.0

    @property
    def kind(self) -> ExperimentKind:
        """Properties of the kind of experiment."""
        return EXPERIMENT_KINDS[self.experiment]

    @cached_property
    def period(self) -> float:
        """Median sampling period in s."""
        return float(np.median(np.diff(self.time)))

    def noise_rms(self, signal: str) -> float:
        """Return the standard deviation of a signal's noise in its SI unit; 0 where it is not known."""
        return self.noise[signal].rms if signal in self.noise else 0.0

    def __contains__(self, signal: str) -> bool:
        return signal in self.signals

    def __getitem__(self, signal: str) -> Array:
        return self.signals[signal]


@dataclass(frozen=True)
class ParameterPrior:
    """Prior knowledge of a parameter, in its unit; None where there is none.

    Attributes:
        unit: Unit of the parameter.
        fixed: Value that identification does not change.
        start: Initial guess.
        lower: Lower bound.
        upper: Upper bound.
        sigma: Standard deviation of ``start``.
    """

    unit: str
    fixed: float | None = None
    start: float | None = None
    lower: float = -math.inf
    upper: float = math.inf
    sigma: float = math.inf


@dataclass(frozen=True)
class Calibration:
    """Standard uncertainty of a sensor's calibration.

    Attributes:
        zero: Of its zero, in the signal's SI unit.
        gain: Of its gain, as a share of the reading.
    """

    zero: float = 0.0
    gain: float = 0.0


@dataclass(frozen=True)
class Rig:
    """Description of the rig, SI; None where the pipeline file omits a value, which is then identified.

    Areas in m^2, volumes in m^3, stroke in m, mass in kg, pressures absolute in Pa, temperature in K, ``gas_constant``
    in J/(kg K).

    Attributes:
        polytropic_exponent: Exponent of the gas in a chamber; None: that of an adiabatic chamber.
        exponent_free: Whether the exponent is identified.
        valve_null: Command in V at which nothing flows.
        null_free: Whether ``valve_null`` is identified.
        null_range: Range in V in which it lies.
        null_ranges: Ranges in V that recordings with filling and venting show, by recording.
        source: What fills the valve, or without a valve the chamber.
        axis_recorded: Whether a recording has a cylinder behind a valve.
        priors: Prior knowledge of parameters by name.
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
    valve_kind: Literal["proportional", "switching", "pressure"] = "proportional"
    source: Literal["regulator", "pump", "ejector"] = "regulator"
    axis_recorded: bool = True
    priors: Mapping[str, ParameterPrior] = field(default_factory=dict)

    @property
    def arrangement(self) -> Arrangement:
        """How the valves are connected to the chambers."""
        return ARRANGEMENTS[self.valve_arrangement]

    def command_sign(self, chamber: Literal[1, 2]) -> float:
        """Return 1 where a larger command fills a chamber (or the vessel on its port), -1 where it vents it."""
        return -1.0 if chamber == 2 and self.arrangement.chamber_2 == "mirrored" else 1.0

    @property
    def has_cylinder(self) -> bool:
        """Whether the pipeline file describes a cylinder."""
        return self.piston_area_1 is not None

    @property
    def vessel_is_chamber(self) -> bool:
        """Whether chamber effects act in the vessel of a valve test: no recording has a chamber of the cylinder."""
        return not (self.has_cylinder and self.axis_recorded)

    @property
    def piston_areas(self) -> tuple[float, float]:
        """Areas in m^2 on which p1 and p2 act; 0 without a piston, equal where only one is given."""
        area_1 = self.piston_area_1 or 0.0
        return area_1, area_1 if self.piston_area_2 is None else self.piston_area_2
