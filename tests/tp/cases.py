"""The three reference cases of fixtures/tp; formulas and constants from each one's params.txt."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pneucli.arrays import Array
from pneucli.tp import sample

FOLDER = Path(__file__).parents[2] / "fixtures" / "tp"


@dataclass(frozen=True)
class Case:
    folder: Path
    names: tuple[str, ...]
    grids: tuple[Array, ...]
    samples: Array

    def table(self, name: str) -> Array:
        """A CSV file of numbers without its header line."""
        return np.loadtxt(self.folder / f"{name}.csv", delimiter=",", skiprows=1, ndmin=2)

    def summary(self, name: str) -> dict[str, dict[str, str]]:
        with (self.folder / f"{name}.csv").open() as file:
            return {row["type"]: row for row in csv.DictReader(file)}


def damping(v: Array, coulomb: Array | float = 2.5, static: Array | float = 3.7) -> Array:
    """a(v) = F(v) / (m v) of case a, with its limit at v = 0."""
    viscous, stribeck, mass, eta = 15.0, 0.019, 1.0, 400.0
    friction = (coulomb + (static - coulomb) / (1 + (v / stribeck) ** 2)) * np.tanh(eta * v / 2) + viscous * v
    limit = (static * eta / 2 + viscous) / mass
    return np.where(v == 0, limit, friction / np.where(v == 0, 1.0, mass * v))


def pressure_damping(v: Array, p: Array) -> Array:
    return damping(v, 2.5 + 0.8e-5 * p, 3.7 + 1.2e-5 * p)


def system(v: Array, p: Array, x: Array) -> Array:
    mass, area, kappa, dead_volume = 1.0, np.pi / 4 * 0.025**2, 1.4, 2e-5
    matrix = np.zeros((*v.shape, 3, 3))
    matrix[..., 0, 1] = 1.0
    matrix[..., 1, 1] = -damping(v)
    matrix[..., 1, 2] = area / mass
    matrix[..., 2, 1] = -kappa * p * area / (dead_volume + area * x)
    return matrix


def _velocity(nodes: int) -> Array:
    """Equidistant and exactly symmetric, so that an odd number of nodes has one at 0."""
    half = np.linspace(-0.05, 0.05, nodes)
    return (half - half[::-1]) / 2


def load() -> dict[str, Case]:
    a, c, d = (FOLDER / name for name in ("a_stribeck_1d", "c_stribeck_pressure_2d", "d_system_SI"))
    of_a = (_velocity(1000),)
    of_c = (_velocity(137), np.linspace(0, 6e5, 101))
    of_d = (_velocity(41), np.linspace(1e5, 7e5, 31), np.linspace(0, 0.2, 21))
    return {
        "a": Case(a, ("v",), of_a, sample(damping, of_a)),
        "c": Case(c, ("v", "p"), of_c, sample(pressure_damping, of_c)),
        "d": Case(d, ("v", "p", "x"), of_d, sample(system, of_d)),
    }


CASES = load()
