"""Uncertainty budgets by the GUM for C, b, m and the cracking pressure of ISO 6358.

The model of a steady bench is its fit: each input (a gauge's zero, its gain, a temperature) is moved by its standard
uncertainty and the rows are fitted again (GUM 5.1.3, note 2). The model of a charge or discharge test is
C = V (dp/dt) / (n R T p_u rho_0) sqrt(T / T_0), whose sensitivities are known in closed form.

References:
    JCGM 100:2008 (GUM), 4.2 (type A), 4.3 (type B), 4.3.8 (bounds on one side), 5.1.2 (combination), 6.2 (k = 2).
    ISO 6358-1:2013 and -2:2013 with their amendments on uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from pneucli.recording import Calibration

COVERAGE_FACTOR = 2.0  # k of the expanded uncertainty: 95 % of a normal distribution
DEFAULT_TEMPERATURE = 1.0  # K: of a gas at room temperature that no sensor measures
DEFAULT_RELATIVE_VOLUME = 0.005  # of a stated volume whose sigma is not stated: filled with water and weighed
MAX_HEAT_TRANSFER = 100.0  # W/(m^2 K): four times the most of free convection of gases (25), for a jet that stirs


@dataclass(frozen=True)
class Contribution:
    """One source of uncertainty.

    Attributes:
        source: What is uncertain.
        kind: ``A`` from the scatter of observations, ``B`` from anything else.
        uncertainty: Standard uncertainty of the source, in ``unit``.
        unit: Unit of the source.
        sensitivity: Derivative of the result by the source, in the result's unit per ``unit``.
        bound: Whether the source lies anywhere between two bounds, one of which the result assumes.
    """

    source: str
    kind: Literal["A", "B"]
    uncertainty: float
    unit: str
    sensitivity: float
    bound: bool = False

    @property
    def contribution(self) -> float:
        """Standard uncertainty of the result from this source, in the result's unit."""
        return abs(self.sensitivity) * self.uncertainty


@dataclass(frozen=True)
class Budget:
    """The uncertainty of one result.

    Attributes:
        name: Name of the result, as in ``parameters.parquet``.
        value: The result.
        unit: Its unit.
        contributions: Its sources.
        interval: What is printed: the value +- the expanded uncertainty, and beyond it the bounds.
        not_stated: Signals whose calibration the pipeline file does not state, so that the budget lacks it.
    """

    name: str
    value: float
    unit: str
    contributions: tuple[Contribution, ...]
    interval: tuple[float, float]
    not_stated: tuple[str, ...] = ()

    @property
    def combined(self) -> float:
        """Combined standard uncertainty, without bounds."""
        return math.sqrt(sum(one.contribution**2 for one in self.contributions if not one.bound))

    @property
    def expanded(self) -> float:
        """Expanded uncertainty, k = 2, without bounds."""
        return COVERAGE_FACTOR * self.combined

    def share(self, one: Contribution) -> float:
        """Return the share of a source in the variance of all sources, bounds included."""
        total = sum(other.contribution**2 for other in self.contributions)
        return one.contribution**2 / total if total > 0.0 else 0.0


@dataclass(frozen=True)
class Measurement:
    """What is known of the instruments.

    Attributes:
        calibrations: Calibration of each signal that states one.
        gauge: Signals that count from ambient pressure: a gain acts on what they read.
        volume_sigma: Standard uncertainty of the vessel's volume in m^3; None: a default share of it.
        temperature_sigma: Standard uncertainty of the gas temperature in K.
    """

    calibrations: Mapping[str, Calibration] = field(default_factory=dict)
    gauge: frozenset[str] = frozenset()
    volume_sigma: float | None = None
    temperature_sigma: float = DEFAULT_TEMPERATURE


def positive_interval(value: float, relative: float, bound: float = 0.0) -> tuple[float, float]:
    """Return the coverage interval of a positive result.

    Args:
        value: The result.
        relative: Combined standard uncertainty over the value, without bounds.
        bound: By how much of the value the result may be larger.

    Returns:
        ``value exp(-k u)`` to ``value (1 + bound) exp(k u)``; for a small u that is value +- k u value.

    >>> [round(end, 3) for end in positive_interval(1.0, 0.01, 0.4)]
    [0.98, 1.428]
    """
    half = min(COVERAGE_FACTOR * relative, 500.0)
    return value * math.exp(-half), value * (1.0 + bound) * math.exp(half)


def smallest_polytropic_index(kappa: float, gas_constant: float, flow: float, volume: float) -> float:
    """Return the smallest index n of dp/dt = n R T q / V that heat from the wall can cause.

    In the balance of energy d(m c_v T)/dt = q c_p T_0 + G (T_0 - T), the temperature settles at
    T / T_0 = (kappa + g) / (1 + g) with g = G / (q c_v), and dp/dt = R T q / V there. G is the largest coefficient of
    heat transfer times the wall of a cube of the volume.

    Args:
        kappa: Ratio of heat capacities.
        gas_constant: Gas constant in J/(kg K).
        flow: Mass flow in kg/s.
        volume: Volume of the chamber in m^3.

    Returns:
        n, between 1 (slow: isothermal) and kappa (fast: adiabatic).

    A valve of 0.36 l/(s bar) at 7 bar fills 160 cm^3 in a third of a second, a hundredth of it in half a minute:

    >>> [round(smallest_polytropic_index(1.4, 287.0, q, 160e-6), 2) for q in (3e-3, 3e-5)]
    [1.22, 1.0]
    """
    wall = 6.0 * math.cbrt(volume) ** 2
    g = MAX_HEAT_TRANSFER * wall * (kappa - 1.0) / (gas_constant * max(flow, 1e-12))
    return (kappa + g) / (1.0 + g)
