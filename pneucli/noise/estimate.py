"""Estimate the noise of a recording: white and first-order coloured noise, mains lines, quantisation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pneucli.noise.mains_lines import detect_mains_lines
from pneucli.noise.model import NORMAL_MAD, NoiseModel
from pneucli.noise.quantisation import quantisation_step
from pneucli.noise.spectrum import NoiseFloor, noise_floor

Array = NDArray[np.float64]

POLE_BOUNDS = (0.2, 0.98)  # of coloured noise: below, it is white; above, the signal's own content
# corner of coloured noise over the lowest frequency of the spectrum, down to which the spectrum shows it
MIN_CORNER_SHARE = 0.27
MAX_ROLL_OFF, MIN_ROLL_OFF = 12.0, 4.0  # a smooth signal's power falls at least like that of a bend, omega^-4
LOG_ZERO_POWER = -60.0  # log of a power that is absent


def estimate_noise(
    time: Array,
    values: Array,
    command_jumps: NDArray[np.bool_] | None = None,
    signal_jumps: NDArray[np.bool_] | None = None,
    *,
    is_motion: bool = False,
) -> NoiseModel:
    """Estimate the noise of one channel of one recording.

    A Whittle fit to the spectrum of the quiet segments separates white noise, AR(1) noise and the signal's own content,
    whose power falls at least like omega^-4 (AR(1): omega^-2). BIC selects white, coloured, or both. Lines are mains
    hum. Below about 80 samples only white noise is estimated, from third-order differences: colour and content of this
    speed cannot be distinguished from white noise there.

    Args:
        time: Time stamps in s, shape (n,).
        values: Signal, NaN where a sample is missing, shape (n,).
        command_jumps: Samples at which a command jumps, which bends the signal, shape (n,).
        signal_jumps: Samples at which the signal itself jumps, shape (n,).
        is_motion: Whether the signal is a position that no accelerometer confirms. Its slow content is then motion,
            and its noise is white unless segments at rest show a colour.

    Returns:
        The noise in the unit of the signal.

    References:
        P. Whittle, Ark. Mat. 2 (1953) 423-434; G. Schwarz, Ann. Stat. 6 (1978) 461-464.

    >>> time = 1e-3 * np.arange(5000)
    >>> estimate = estimate_noise(time, 2.0 * np.random.default_rng(1).standard_normal(time.size))
    >>> abs(estimate.rms - 2.0) < 0.1
    True
    """
    period = float(np.median(np.diff(time))) if time.size > 1 else 1e-3
    step = quantisation_step(values)
    if not step and np.median(np.abs(np.diff(values))) == 0:
        return NoiseModel(white=0.0, period=period)  # a command, constant between its jumps
    floor = noise_floor(values, period, command_jumps, signal_jumps)
    rest = noise_floor(values, period, command_jumps, signal_jumps, at_rest=True) if is_motion else floor
    if floor is None:
        return NoiseModel(white=_white_noise_from_differences(values), period=period, step=step)
    min_power = max(step**2 / 1200, float(np.finfo(float).tiny) ** 0.5)
    lines = detect_mains_lines(values, period)
    spectrum = _without_lines(rest or floor, lines, period, min_power)
    model = _whittle(spectrum, period, may_be_coloured=rest is not None)
    return replace(model, lines=lines, step=step)


def pool_noise(models: Sequence[NoiseModel]) -> NoiseModel:
    """Pool the noise of one sensor over several recordings.

    The median power is that of all recordings, so that one recording full of motion has no influence. White and
    coloured shares and lines are means of the powers; the pole is a mean weighted by the coloured power.

    Args:
        models: Estimates of the same sensor.

    Returns:
        The noise of the sensor.

    >>> pool_noise([NoiseModel(1.0), NoiseModel(1.0), NoiseModel(5.0)]).white
    1.0
    """
    white = np.array([m.white**2 for m in models])
    coloured = np.array([m.coloured**2 for m in models])
    total, shared = float(np.median(white + coloured)), float(np.sum(white + coloured))
    scale = np.sqrt(total * len(models) / shared) if shared else 0.0
    pole = float(np.average([m.pole for m in models], weights=coloured)) if coloured.any() else 0.0
    steps = [m.step for m in models if m.step]
    return NoiseModel(
        white=float(scale * np.sqrt(white.mean())),
        coloured=float(scale * np.sqrt(coloured.mean())),
        pole=pole,
        period=float(np.median([m.period for m in models])),
        lines=_pooled_lines(models),
        step=min(steps, default=0.0),
    )


def _pooled_lines(models: Sequence[NoiseModel]) -> tuple[tuple[float, float], ...]:
    nominal = sorted({round(f / 10) * 10 for m in models for f, _ in m.lines})
    pooled = []
    for centre in nominal:
        matches = [[(f, a) for f, a in m.lines if abs(f - centre) < 5] for m in models]
        hits = [line for lines in matches for line in lines]
        if 2 * sum(map(bool, matches)) >= len(models):
            power = sum(a * a for _, a in hits) / len(models)
            pooled.append((float(np.mean([f for f, _ in hits])), float(np.sqrt(power))))
    return tuple(pooled)


def _white_noise_from_differences(values: Array) -> float:
    finite = values[np.isfinite(values)]
    order = min(3, finite.size - 1)
    if order < 1:
        return 0.0
    differences = np.diff(finite, order)
    robust = NORMAL_MAD * float(np.median(np.abs(differences)))
    return min(robust, float(np.sqrt(np.mean(differences**2)))) / math.sqrt(math.comb(2 * order, order))


def _without_lines(
    floor: NoiseFloor, lines: tuple[tuple[float, float], ...], period: float, min_power: float
) -> NoiseFloor:
    keep = np.ones(floor.omega.size, dtype=bool)
    width = 2.5 * (floor.omega[1] - floor.omega[0])
    for frequency, _ in lines:
        keep &= np.abs(floor.omega - 2 * np.pi * frequency * period) > width
    return NoiseFloor(floor.omega[keep], np.maximum(floor.power[keep], min_power), floor.weight)


def _whittle(floor: NoiseFloor, period: float, *, may_be_coloured: bool) -> NoiseModel:
    level = float(np.log(np.median(floor.power[floor.power.size // 2 :])))
    # per model: start and bounds of log white, log coloured power, pole
    white, coloured = (level, (level - 8, level + 8)), (level + 1, (level - 8, level + 8))
    absent, no_pole = _fixed(LOG_ZERO_POWER), _fixed(0.0)
    bounds = (POLE_BOUNDS[0], max(POLE_BOUNDS[1], float(np.exp(-MIN_CORNER_SHARE * floor.omega[0]))))
    choices = [[white, absent, no_pole]]
    if may_be_coloured:
        choices += [[part, coloured, (pole, bounds)] for part in (absent, white) for pole in (0.5, 0.9)]
    fits = [_fit(floor, choice) for choice in choices]
    log_white, log_coloured, pole = min(fits, key=lambda fit: fit[0])[1][:3]
    return NoiseModel(
        white=float(np.exp(log_white / 2)) if log_white > LOG_ZERO_POWER else 0.0,
        coloured=float(np.exp(log_coloured / 2)) if log_coloured > LOG_ZERO_POWER else 0.0,
        pole=float(pole),
        period=period,
    )


def _fixed(value: float) -> tuple[float, tuple[float, float]]:
    return value, (value, value)


def _fit(floor: NoiseFloor, choice: list[tuple[float, tuple[float, float]]]) -> tuple[float, Array]:
    """Return the BIC and the parameters (log white, log coloured power, pole, log content, its roll-off)."""
    from scipy.optimize import minimize  # noqa: PLC0415 - slow to import, and only ingest estimates noise

    low = float(np.log(floor.power[0]))
    start = np.array([s for s, _ in choice] + [low, 6.0])
    bounds = [b for _, b in choice] + [(low - 40, low + 5), (MIN_ROLL_OFF, MAX_ROLL_OFF)]

    def deviance(p: Array) -> tuple[float, Array]:
        model, slopes = _power(floor.omega, p)
        change = floor.weight * (1.0 - floor.power / model) / model
        return float(floor.weight * np.sum(np.log(model) + floor.power / model)), slopes @ change

    best = minimize(deviance, start, method="L-BFGS-B", jac=True, bounds=bounds)
    free = sum(low < high for low, high in bounds)
    return 2 * float(best.fun) + free * float(np.log(floor.omega.size * floor.weight)), best.x


def _power(omega: Array, p: Array) -> tuple[Array, Array]:
    """Return the power (n,) at angular frequencies a sample ``omega`` (n,), and its derivatives (5, n)."""
    white, pole, fall = np.exp(p[0]), p[2], np.log(np.sin(omega / 2) / np.sin(omega[0] / 2))
    below = 1 - 2 * pole * np.cos(omega) + pole**2
    coloured = np.exp(p[1]) * (1 - pole**2) / below
    by_pole = -2 * (np.exp(p[1]) * pole + coloured * (pole - np.cos(omega))) / below
    content = np.exp(p[3] - p[4] * fall)
    slopes = [np.full(omega.size, white), coloured, by_pole, content, -content * fall]
    return np.asarray(white + coloured + content), np.array(slopes)
