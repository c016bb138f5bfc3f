"""Valve tests of a valve of known law, simulated apart from the package's own equations; and the fit before."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from pneucli.identify.estimation.fit import Fit
from pneucli.identify.estimation.model_fit import fit_model
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.identify.valve.identification import ValveIdentification, identify_valve
from pneucli.noise import NoiseModel
from pneucli.physics.effects import catalogue
from pneucli.recording import Recording, Rig
from pneucli.simulate.preparation import prepare

RIG = Rig(supply_pressure=6.5e5, vessel_volume=2e-4)
AREA, OVERLAP, EXPONENT = 1.6e-6, 0.2, 1.1  # m^2 at 10 V, V, 1
COMMANDS = (0.6, 1.2, 2.5, 5.0, 10.0)
NOISE = NoiseModel(white=0.0, coloured=400.0, pole=0.6)


def true_gradient(u, p, rig: Rig = RIG, b: float = 0.528, leak: float = 0.0):
    """Thesis 2.22, 2.42, 2.46 with the area law above; written out here, apart from the package's own."""
    gas = rig.heat_capacity_ratio * np.sqrt(2 * rig.gas_constant * rig.gas_temperature) / rig.vessel_volume
    area = AREA * (np.maximum(np.abs(u) - OVERLAP, 0) / (10 - OVERLAP)) ** EXPONENT

    def stream(upstream, downstream, ratio):
        s = np.clip((downstream / upstream - ratio) / (1 - ratio), 0, 1)
        return gas * upstream * 0.484 * np.sqrt(1 - s * s)

    fills = stream(rig.supply_pressure, np.minimum(p, rig.supply_pressure), b)
    vents = stream(p, np.minimum(p, rig.ambient_pressure), b)
    lost = leak * stream(p, np.minimum(p, rig.ambient_pressure), 0.528)
    return area * np.where(u > 0, fills, -vents) - lost


def record(name: str, command: float, seed: int, noise: NoiseModel = NOISE, use: str = "train", **law) -> Recording:
    """Rest, charge at +command, rest, discharge at -command; 1 kHz, high-order integration."""
    time = np.arange(0.0, 2.4, 1e-3)
    u = np.select([time < 0.1, time < 1.2, time < 1.3], [0.0, command, 0.0], -command)
    p = np.empty(time.size)
    edges = [0, 100, 1200, 1300, time.size]
    start = RIG.ambient_pressure
    for a, b in pairwise(edges):
        span = time[a] + 1e-3 * np.arange(b - a + 1)
        right = lambda _, q, v=u[a]: true_gradient(v, q, **law)  # noqa: E731
        found = solve_ivp(right, (span[0], span[-1]), [start], t_eval=span, rtol=1e-7, atol=1.0, max_step=0.02)
        p[a:b], start = found.y[0][:-1], found.y[0][-1]
    rng = np.random.default_rng(seed)
    supply = np.full(time.size, RIG.supply_pressure) + noise.draw(time, rng)
    signals = {"u": u, "p_supply": supply, "p1": p + noise.draw(time, rng)}
    return Recording(name, "valve", use, time, signals)


def recordings(seed: int, commands: Sequence[float] = COMMANDS, **law) -> list[Recording]:
    return [record(f"step {c} V", c, 100 * seed + k, **law) for k, c in enumerate(commands)]


def fitted(tests: Sequence[Recording], rig: Rig, effects: Sequence[str] = ()) -> Fit:
    """The model that was fitted to the tests."""
    train = [prepare(r, rig, 0.5) for r in tests if r.use == "train"]
    return fit_model(guess_base_model(train, rig, "map"), residual_models(train), [catalogue()[e] for e in effects])


def identify(tests: Sequence[Recording], rig: Rig = RIG, effects: Sequence[str] = ()) -> ValveIdentification:
    """The valve of the tests, with a model that has these effects."""
    return identify_valve([prepare(r, rig, 0.5) for r in tests], fitted(tests, rig, effects))
