"""How well does an encoder tell the motion? ``python -m benchmarks.encoder [SEED...]``

A mass of 3.5 kg with 20 N of dry friction is driven by steps of force and by two sines, seen by an encoder. A row each:
rms error of velocity and acceleration by the smoother, with one intensity of the jerk for all of the recording, and by
the Savitzky-Golay window that errs least, which only the truth tells; the share of samples within 1.96 stated
deviations; the mass that least squares of the force find with each of the three.
"""

import sys
from collections.abc import Callable

import numpy as np
from numba import njit
from scipy.signal import savgol_filter

from pneucli.arrays import Array
from pneucli.noise import NoiseModel
from pneucli.simulate.position_smoother import (
    PositionSmoother,
    fit_position_smoother,
    kalman_filter,
    low_frequency_deviation,
)

STEP, DURATION = 2e-5, 16.0  # s
MASS, COULOMB, VISCOUS = 3.5, 20.0, 40.0
# s; m: step and noise
SENSORS = ((1e-3, 1e-6, 2e-5), (2e-3, 2e-5, 3e-6), (5e-3, 2e-5, 3e-6), (2e-3, 5e-6, 7.5e-7), (5e-4, 1e-4, 3e-6))


@njit
def stick_slip(force: Array) -> tuple[Array, Array, Array]:
    """Return x, v and a of the mass, each (n,), by steps of ``STEP``."""
    x, v, a = np.zeros(force.size), np.zeros(force.size), np.zeros(force.size)
    for k in range(force.size - 1):
        direction = np.sign(v[k]) if v[k] != 0.0 else np.sign(force[k])
        if v[k] != 0.0 or abs(force[k]) > COULOMB:
            a[k] = (force[k] - direction * COULOMB - VISCOUS * v[k]) / MASS
        v[k + 1] = v[k] + STEP * a[k]
        if v[k] * v[k + 1] < 0.0:
            v[k + 1] = 0.0
        x[k + 1] = x[k] + 0.5 * STEP * (v[k] + v[k + 1])
    return x, v, a


def steps(rng: np.random.Generator, time: Array) -> Array:
    """Return levels of force that follow one another within 50 ms."""
    levels = np.repeat(rng.uniform(-70.0, 70.0, 32), time.size // 32 + 1)[: time.size]
    return np.convolve(levels, np.full(2500, 1 / 2500), mode="same")


def sines(rng: np.random.Generator, time: Array) -> Array:
    """Return a slow sine with a faster one."""
    slow, fast = rng.uniform(0.3, 0.6), rng.uniform(1.5, 3.0)
    return np.asarray(70.0 * np.sin(2 * np.pi * slow * time) + 30.0 * np.sin(2 * np.pi * fast * time))


def even_smoother(time: Array, x: Array, noise: NoiseModel) -> PositionSmoother:
    """Return the smoother with the one intensity that is likeliest."""
    sigma = low_frequency_deviation(noise)
    tried = [PositionSmoother(time, sigma, np.full(time.size - 1, q)) for q in 10.0 ** np.arange(-9, 4, 0.5)]
    period = np.diff(time) / tried[0].period
    return max(tried, key=lambda one: kalman_filter((x - x[0]) / sigma, period, one.intensity)[-1])


def rms(error: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(error**2)))


def mass(v: Array, a: Array, force: Array) -> float:
    """Return the mass in kg by least squares of the force where the mass moves."""
    moving = np.abs(v) > 0.02
    return float(np.linalg.lstsq(np.column_stack([a, np.sign(v), v])[moving], force[moving])[0][0])


def row(drive: Callable[[np.random.Generator, Array], Array], sensor: tuple[float, float, float], seed: int) -> str:
    """Return one row of the table."""
    period, step, noise = sensor
    rng, fine = np.random.default_rng(seed), STEP * np.arange(round(DURATION / STEP))
    force = drive(rng, fine)
    every = slice(None, -1, round(period / STEP))
    time, force, (x, v, a) = fine[every], force[every], (y[every] for y in stick_slip(force))
    read = step * np.round((x + noise * rng.standard_normal(x.size)) / step)
    model = NoiseModel(float(np.hypot(noise, step / np.sqrt(12))), period=period, step=step)
    smoother = fit_position_smoother(time, read, model)
    _, v_found, a_found = smoother(read)
    _, v_even, a_even = even_smoother(time, read, model)(read)
    local = [
        (savgol_filter(read, n, 2, deriv=1, delta=period), savgol_filter(read, n, 3, deriv=2, delta=period))
        for n in range(5, 121, 4)
    ]
    v_local, a_local = (
        min((y for y, _ in local), key=lambda y: rms(y - v)),
        min((y for _, y in local), key=lambda y: rms(y - a)),
    )
    drawn = [smoother.draw_error(smoother.sigma * rng.standard_normal(x.size))[1:] for _ in range(20)]
    covered = [
        float(np.mean(np.abs(f - y) < 1.96 * d))
        for f, y, d in zip((v_found, a_found), (v, a), np.sqrt(np.mean(np.square(drawn), axis=0)), strict=True)
    ]
    cells = [drive.__name__, f"{1e3 * period:g} ms, {1e6 * step:g} um"]
    cells += [f"{1e3 * rms(y - v):.2f}" for y in (v_found, v_even, v_local)]
    cells += [f"{rms(y - a):.3f}" for y in (a_found, a_even, a_local)]
    cells += [f"{100 * share:.1f}" for share in covered]
    pairs = ((v_found, a_found), (v_even, a_even), (v_local, a_local))
    cells += [f"{mass(*pair, force):.2f}" for pair in pairs]
    return "| " + " | ".join(cells) + " |"


def main(arguments: list[str]) -> None:
    """Print the table; three numbers are smoother, one intensity, best local polynomial."""
    is_small = "--small" in arguments
    print("| drive | encoder | v, mm/s | | | a, m/s2 | | | v in, % | a in, % | mass, kg | | |")
    print("|" + " --- |" * 13)
    for seed in [0] if is_small else [int(seed) for seed in arguments] or [0]:
        for drive in (steps,) if is_small else (steps, sines):
            for sensor in SENSORS[:1] if is_small else SENSORS:
                print(row(drive, sensor, seed), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
