"""Uncertainty budgets by the GUM for C, b, m and the cracking pressure of ISO 6358.

The model of a steady bench is its fit: each input (a gauge's zero, its gain, a temperature) is moved by its standard
uncertainty and the rows are fitted again (GUM 5.1.3, note 2). The model of a charge or discharge test is
C = V (dp/dt) / (n R T p_u rho_0) sqrt(T / T_0), whose sensitivities are known in closed form.

The thermal state of the gas is a source of which bounds are known and nothing else. A distribution of it depends on the
variable that is drawn evenly: the index n and the wall's heat give a slow valve intervals of C that do not meet.
The interval therefore holds for every state between the bounds.

References:
    JCGM 100:2008 (GUM), 4.2 (type A), 4.3 (type B), 4.3.8 (bounds that are not symmetric), 5.1.2
    (combination), 6.2 (k = 2).
    ISO 6358-1:2013 and -2:2013 with their amendments on uncertainty.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.special import ndtr

from pneucli.figure import Figure
from pneucli.messages.identify import Budget, Source
from pneucli.recording import Calibration

COVERAGE_FACTOR = 2.0  # k of the expanded uncertainty: 95 % of a normal distribution
DEFAULT_TEMPERATURE = 1.0  # K: of a gas at room temperature that no sensor measures
DEFAULT_RELATIVE_VOLUME = 0.005  # of a stated volume whose sigma is not stated: filled with water and weighed
QUADRATURE_POINTS = 200  # over a rectangle: a normal distribution narrower than a hundredth of it is widened to that


def contribution(
    source: str,
    kind: Literal["A", "B"],
    uncertainty: float,
    unit: str,
    sensitivity: float,
    factors: tuple[float, float] | None = None,
) -> Source:
    """Return one source of uncertainty; its share is that of :func:`budget_from`.

    Args:
        source: What is uncertain.
        kind: ``A`` from the scatter of observations, ``B`` from anything else.
        uncertainty: Standard uncertainty of the source, in ``unit``.
        unit: Unit of the source.
        sensitivity: Derivative of the result by the source, in the result's unit per ``unit``.
        factors: Of a bounded source: the least and the largest factor on the result. Nothing is known of the factor but
            its bounds, so that no distribution of it is right; ``uncertainty`` is that of a rectangle (GUM 4.3.8).
    """
    size, is_bound = abs(sensitivity) * uncertainty, factors is not None
    return Source(source, kind, uncertainty, unit, sensitivity, size, math.nan, is_bound, factors)


def budget_from(figure: Figure, sources: Sequence[Source], not_stated: Sequence[str] = ()) -> Budget:
    """Return the uncertainty of one result.

    Args:
        figure: What is printed: the value +- the expanded uncertainty, from the lower to the upper bound.
        sources: Its sources.
        not_stated: Signals whose calibration the pipeline file does not state, so that the budget lacks it.

    Returns:
        The budget: the combined uncertainty without bounds, the share of each source in the variance of all, bounds
        included, and the 95 % interval by JCGM 101 if a bounded source were drawn evenly.
    """
    combined = math.sqrt(sum(one.contribution**2 for one in sources if not one.bound))
    total = sum(one.contribution**2 for one in sources)
    shared = [replace(one, share=one.contribution**2 / total if total > 0.0 else 0.0) for one in sources]
    bounds = next((one.factors for one in sources if one.factors), None)
    drawn = None if bounds is None else propagated_interval(figure.value, combined / figure.value, bounds)
    return Budget(figure, combined, COVERAGE_FACTOR * combined, drawn, not_stated, shared)


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


def positive_interval(value: float, relative: float, factors: tuple[float, float] = (1.0, 1.0)) -> tuple[float, float]:
    """Return the coverage interval of a positive result.

    Args:
        value: The result.
        relative: Combined standard uncertainty over the value, without the bounded source.
        factors: Least and largest factor of the bounded source.

    Returns:
        ``value least exp(-k u)`` to ``value largest exp(k u)``; without a bounded source and for a small u that is
        value +- k u value. Whatever the factor is, at least 95 % of the results lie inside.

    >>> [round(end, 3) for end in positive_interval(1.0, 0.01, (1.0, 1.4))]
    [0.98, 1.428]
    """
    half = min(COVERAGE_FACTOR * relative, 500.0)
    return value * factors[0] * math.exp(-half), value * factors[1] * math.exp(half)


def propagated_interval(value: float, relative: float, factors: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of a result whose factor is drawn evenly between its bounds, by JCGM 101.

    The result is value F (1 + u Z) with F rectangular and Z normal; its distribution function is a mean of normal ones.

    Args:
        value: The result.
        relative: Combined standard uncertainty over the value, without the bounded source.
        factors: Least and largest factor F.

    Returns:
        The 2.5 and the 97.5 % quantile.

    References:
        JCGM 101:2008, 5.3.4 (probabilistically symmetric interval), 6.4.2 (rectangular distribution).

    >>> [round(end, 3) for end in propagated_interval(1.0, 1e-6, (1.0, 1.4))]  # 95 % of the rectangle
    [1.01, 1.39]
    """
    from scipy.optimize import brentq  # noqa: PLC0415 - slow to import, and few budgets ask for it

    middle, half = 0.5 * (factors[1] + factors[0]), 0.5 * (factors[1] - factors[0])
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    places = middle + half * nodes
    spread = np.maximum(relative * places, 2.0 * half / QUADRATURE_POINTS + 1e-12)

    def below(end: float) -> float:
        return float(np.sum(0.5 * weights * ndtr((end - places) / spread)))

    low, high = factors[0] - 9.0 * float(spread.max()), factors[1] + 9.0 * float(spread.max())
    ends = [float(brentq(lambda end, share=share: below(end) - share, low, high)) for share in (0.025, 0.975)]
    return value * ends[0], value * ends[1]
