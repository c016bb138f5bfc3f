"""Motion that a machine imposes: kinetic friction per recording, and a force that is compared."""

import numpy as np
import pytest
from scipy.io import loadmat

from pneucli.identify.friction.identification import FrictionIdentification, identify_friction
from pneucli.noise import NoiseModel
from pneucli.recording import Recording, Rig
from pneucli.simulate.model import Model
from tests.identify_friction.synthetic_recordings import real

AMBIENT = 101_325.0


def stroking(level: float, pressure: float, offset: float = 0.0, seed: int = 0) -> Recording:
    """Ten strokes of 40 mm at 10 mm/s, 100 Hz, against a chamber 2 under pressure (Pa, gauge), noise of 0.1 N."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(8000)
    x = 0.02 + 0.02 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * time / 8.0))
    friction = level * np.sign(np.gradient(x, time))
    force = friction + offset + pressure * 5e-4 + 0.1 * rng.standard_normal(time.size)
    signals = {"x": x + 2e-5 * rng.standard_normal(time.size), "p2": np.full(8000, AMBIENT + pressure), "force": force}
    noise = {"x": NoiseModel(white=2e-5, period=0.01), "force": NoiseModel(white=0.1), "p2": NoiseModel(white=0.0)}
    return Recording(f"{pressure:.0f} Pa", "friction", "train", time, signals, noise, imposed="motion")


RIG = Rig(ambient_pressure=AMBIENT, piston_area_1=5e-4, piston_area_2=5e-4)


def test_kinetic_friction_is_half_the_difference_of_the_directions() -> None:
    levels = {1e5: 4.0, 3e5: 5.5, 7e5: 8.0}
    found = identify_friction([stroking(f, p, offset=0.7) for p, f in levels.items()], Model(RIG))
    for one, (pressure, level) in zip(found.kinetic, levels.items(), strict=True):
        # 0.1 N of noise over some 3800 samples a direction, and the few samples beside the turns
        assert one.friction.value == pytest.approx(level, abs=0.02)
        assert one.offset.value == pytest.approx(0.7, abs=0.02)
        assert one.pressures["p2"] == pytest.approx(AMBIENT + pressure)
        assert one.speed == pytest.approx(0.01, rel=0.05)
    assert "levels-differ" in {warning.code for warning in found.warnings}


def test_an_unidentifiable_mass_is_neglected_with_a_warning() -> None:
    found = identify_friction([stroking(4.0, 1e5)], Model(RIG))
    assert found.mass is None
    assert "mass-not-identifiable" in {warning.code for warning in found.warnings}
    assert {d.channel for d in found.deviations} == {"force"}


def test_an_observable_mass_is_identified() -> None:
    time = 1e-3 * np.arange(8000)
    x = 0.1 + 0.05 * np.sin(2 * np.pi * time) + 0.02 * np.sin(2 * np.pi * 2.3 * time)
    v = np.gradient(x, time)
    rng = np.random.default_rng(0)
    force = 20.0 * np.gradient(v, time) + 15.0 * np.sign(v) + 80.0 * v - 3.0 + rng.standard_normal(8000)
    noise = {"x": NoiseModel(white=1e-6), "force": NoiseModel(white=1.0)}
    signals = {"x": x + 1e-6 * rng.standard_normal(8000), "force": force}
    found = identify_friction(
        [Recording("r", "friction", "train", time, signals, noise, imposed="motion")], Model(Rig())
    )
    assert found.mass is not None
    for value, truth in ((found.mass, 20.0), (found.parameters["coulomb"], 15.0), (found.parameters["viscous"], 80.0)):
        assert value.value == pytest.approx(truth, rel=0.03)
    assert found.offset == pytest.approx(-3.0, abs=0.3)


# N at 1, 3, 5 and 7 bar: half the difference of retract and extend medians, as the data's readme has it
SEALS = {
    "O-ring": (3.98, 5.50, 7.16, 7.98),
    "PK": (2.64, 3.58, 5.19, 6.60),
    "KDN": (5.65, 5.75, 6.12, 6.94),
    "X-ring257": (4.56, 6.50, 8.63, 15.53),
}


@pytest.mark.real
@pytest.mark.parametrize("seal", SEALS)
def test_seal_friction_against_chamber_pressure(seal: str) -> None:
    """Bore 25 mm (25.7 mm for X-ring257); x grows while the piston is pushed in, so the chamber is chamber 2."""
    area = np.pi / 4 * (0.0257 if seal == "X-ring257" else 0.025) ** 2
    recordings = []
    for bar in (1, 3, 5, 7):
        rows = np.loadtxt(real("zillen") / f"{seal}_{bar}bar.csv")[15:]  # before, the sensors start up
        rows = rows[np.diff(rows[:, 0], prepend=-1.0) > 0]
        signals = {"x": rows[:, 4] / 1e3, "p2": rows[:, 5] * 1e5 + AMBIENT, "force": rows[:, 6]}
        recordings.append(Recording(f"{bar}", "friction", "train", rows[:, 0] / 1e3, signals, imposed="motion"))
    rig = Rig(ambient_pressure=AMBIENT, piston_area_1=area, piston_area_2=area)
    found = identify_friction(recordings, Model(rig))
    # where a stroke begins and ends is judged otherwise than in the readme's figures
    assert [k.friction.value for k in found.kinetic] == pytest.approx(SEALS[seal], rel=0.02)


@pytest.mark.real
def test_positioning_system_has_its_published_parameters() -> None:
    """EMPS (Janot, Gautier, Brunot 2019): M 95.109 kg, Fv 203.50 N s/m, Fc 20.39 N, offset -3.165 N, error 4.08 %."""
    found = emps()
    assert found.mass is not None
    assert found.mass.value == pytest.approx(95.109, rel=0.01)
    for name, published in (("coulomb", 20.39), ("viscous", 203.50), ("offset", -3.165)):
        assert found.parameters[name].value == pytest.approx(published, rel=0.06)
        assert found.parameters[name].low < published < found.parameters[name].high
    error = next(d for d in found.deviations if (d.model, d.recording) == ("A", "train"))
    assert error.relative_percent < 4.6


def emps() -> FrictionIdentification:
    table = loadmat(real("emps") / "DATA_EMPS.mat")
    x, drive = (table[key].ravel().astype(float) for key in ("qm", "vir"))
    signals = {"x": x, "force": 35.15065188 * drive}
    return identify_friction(
        [Recording("train", "friction", "train", table["t"].ravel().astype(float), signals, imposed="motion")],
        Model(Rig()),
    )
