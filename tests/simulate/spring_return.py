"""A piston against a preloaded spring that rests on its stop: a rig of its own, by none of the program's equations."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig

AMBIENT = 101_325.0  # Pa
PERIOD = 1e-3  # s
SUBSTEPS = 10
STEP_SAMPLES, RISE_TIME = 700, 0.08  # of the pressures
NOISE = {"p1": 200.0, "p2": 200.0, "x": 5e-6}


@dataclass(frozen=True)
class Piston:
    """Areas in m^2, mass in kg, spring in N/m with its force at x = 0 in N, friction in N and N s/m, stroke in m.
    Dry friction grows by ``seal`` (m^2) times both pressures above ambient.

    p1 goes from level to level between ``lowest`` and ``highest`` (Pa), p2 swings by ``opposed`` (Pa). The piston
    starts at ``start`` (m).
    """

    area_1: float
    area_2: float
    mass: float
    stiffness: float
    preload: float
    coulomb: float
    viscous: float
    stroke: float
    lowest: float
    highest: float
    opposed: float = 0.0
    start: float = 0.0
    seal: float = 0.0

    def rig(self, **stated: Any) -> Rig:
        """The rig as its owner describes it: the spring is not mentioned."""
        known = Rig(
            ambient_pressure=AMBIENT,
            supply_pressure=7e5,
            piston_area_1=self.area_1,
            piston_area_2=self.area_2,
            stroke=self.stroke,
            dead_volume_1=0.1 * self.area_1 * self.stroke,
            dead_volume_2=0.1 * self.area_2 * self.stroke,
            moving_mass=self.mass,
        )
        return replace(known, **stated)

    def positions(self, p1: np.ndarray, p2: np.ndarray) -> np.ndarray:
        """Positions in m under pressures in Pa: dry friction and hard stops without rebound, Euler steps."""
        push = self.area_1 * (p1 - AMBIENT) - self.area_2 * (p2 - AMBIENT) - self.preload
        dry = self.coulomb + self.seal * (p1 + p2 - 2.0 * AMBIENT)
        places = np.arange(SUBSTEPS * (push.size - 1) + 1) / SUBSTEPS
        fine, fine_dry = (np.interp(places, np.arange(push.size), values) for values in (push, dry))
        h, x, v, out = PERIOD / SUBSTEPS, self.start, 0.0, np.zeros(fine.size)
        inertia = self.mass / h
        for k, (force, held) in enumerate(zip(fine.tolist(), fine_dry.tolist(), strict=True)):
            out[k] = x
            drive = inertia * v + force - self.stiffness * x
            v = math.copysign(max(abs(drive) - held, 0.0), drive) / (inertia + self.viscous)
            x += h * v
            if not 0.0 < x < self.stroke:
                x, v = min(max(x, 0.0), self.stroke), 0.0
        return out[::SUBSTEPS]


# a cylinder whose spring brings it back, and a valve's actuator with air on both sides and a stiff preloaded spring
CYLINDER = Piston(8.04e-4, 7.0e-4, 1.5, 900.0, 45.0, 14.0, 60.0, 0.05, 1.0e5, 2.6e5)
ACTUATOR = Piston(0.03, 0.03, 12.0, 48_000.0, 2_400.0, 0.0, 6_000.0, 0.03, 1.9e5, 2.5e5, 2e4)

LEAVING_TIME, STOP_SCATTER, MIN_MOTION_SAMPLES = 0.05, 3e-5, 300  # s and m, around a rest on a stop


def steps(samples: int, lowest: float, highest: float, seed: int) -> np.ndarray:
    """A pressure in Pa that goes smoothly from one random level to the next; the first is ambient pressure."""
    levels = np.random.default_rng(seed).uniform(lowest, highest, samples // STEP_SAMPLES + 1)
    levels[0] = AMBIENT
    smooth = levels.repeat(STEP_SAMPLES)[:samples]
    for _ in range(2):
        smooth = lfilter([PERIOD / RISE_TIME], [1.0, PERIOD / RISE_TIME - 1.0], smooth - AMBIENT) + AMBIENT
    return np.asarray(smooth)


def recording(piston: Piston, p1: np.ndarray, p2: np.ndarray, name: str = "a", use: str = "train") -> Recording:
    """What p1, p2 and x sensors read while these pressures act."""
    time, rng = PERIOD * np.arange(p1.size), np.random.default_rng(sum(map(ord, name)))
    true = {"p1": p1, "p2": p2, "x": piston.positions(p1, p2)}
    noise = {n: NoiseModel(rms) for n, rms in NOISE.items()}
    read = {n: values + noise[n].draw(time, rng) for n, values in true.items()}
    return Recording(name, "friction", use, time, read, noise, "valve")  # type: ignore[arg-type]


def motions(one: Recording, piston: Piston) -> list[Recording]:
    """The recording without its rests on the stops, as recordings of each motion in between."""
    margin = round(LEAVING_TIME / PERIOD)
    resting = np.minimum(one["x"], piston.stroke - one["x"]) < STOP_SCATTER
    long = np.convolve(resting, np.ones(2 * margin + 1), mode="same") > 2 * margin + 0.5
    edges = np.flatnonzero(np.diff(~long, prepend=False, append=False)).reshape(-1, 2)
    parts = [slice(first, last) for first, last in edges.tolist() if last - first > MIN_MOTION_SAMPLES]
    return [
        replace(
            one,
            name=f"{one.name}{k}",
            time=one.time[part],
            signals={n: values[part] for n, values in one.signals.items()},
        )
        for k, part in enumerate(parts)
    ]


def recordings(piston: Piston, samples: int = 12_000) -> list[Recording]:
    """Three recordings of a piston, the last of which is for testing."""
    p2 = AMBIENT + piston.opposed * (1.5 + np.sin(2 * np.pi * 0.7 * PERIOD * np.arange(samples)))
    uses = {"a": "train", "b": "train", "c": "test"}
    return [
        recording(piston, steps(samples, piston.lowest, piston.highest, seed), p2, name, use)
        for seed, (name, use) in enumerate(uses.items())
    ]
