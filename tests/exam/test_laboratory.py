"""What a laboratory hands over: takes, files, and a pipeline file that says what a lab would know."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam import cases
from pneucli.exam.hidden_effects import CATALOGUE, UNCATALOGUED
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import two_sine_reference
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation
from pneucli.physics.effects import catalogue
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.synthetic_experiments import model

PAR = Parameters(overlap=0.25, effective_area=2e-6, exponent=1.2)
RNG = np.random.default_rng


# --- manoeuvres


def test_a_reference_wanders_about_the_middle_and_within_the_stroke() -> None:
    paths = np.array([two_sine_reference(RNG(seed), 8000) for seed in range(60)])
    assert np.all(paths[:, 0] == 0.1)
    assert paths.min() >= 0.015
    assert paths.max() <= 0.185
    assert np.ptp(paths, axis=1).min() > 0.08
    assert {np.sign(path[200] - 0.1) for path in paths} == {-1.0, 1.0}
    # what is fast is slow enough to be followed: half a metre a second
    assert np.abs(np.diff(paths, axis=1)).max() < 0.5e-3
    turns = [np.count_nonzero(np.diff(np.sign(path - 0.1))) for path in paths]
    assert min(turns) >= 3
    assert max(turns) <= 30


# --- sensors


def readings(par: Parameters, sensors: Sensors, **truth: np.ndarray) -> dict[str, np.ndarray]:
    n = 1000
    whole = {name: np.zeros(n) for name in ("u", "u2", "x", "a")} | {
        p: np.full(n, par.ambient) for p in ("p1", "p2", "p_supply")
    }
    return measure(par, sensors, whole | truth, RNG(1))


QUIET = Sensors(pressure=0.0, acceleration=0.0, position_step=0.0)


def test_an_ideal_sensor_reads_the_true_gauge_pressure() -> None:
    ramp = np.linspace(0.0, 1.0, 1000)
    seen = readings(PAR, QUIET, u=ramp, x=ramp, a=ramp, p1=2e5 + ramp, p2=3e5 + ramp, p_supply=7e5 + ramp)
    for name, offset in (("u", 0.0), ("x", 0.0), ("a", 0.0), ("p1", 2e5), ("p2", 3e5), ("p_supply", 7e5)):
        assert seen[name] == pytest.approx(ramp + offset - (PAR.ambient if offset else 0.0))


def test_only_p1_has_the_offset_and_the_curve_and_both_have_the_scale() -> None:
    par = PAR._replace(pressure_offset=1e3, pressure_curvature=1e-7, pressure_scale=1.1)
    seen = readings(par, QUIET, p1=np.full(1000, par.ambient + 1e5), p2=np.full(1000, par.ambient + 1e5))
    assert seen["p1"][0] == pytest.approx(1.1e5 + 1e3 + 1e-7 * 1.1e5**2)
    assert seen["p2"][0] == pytest.approx(1.1e5)


def test_positions_are_counted_in_steps_and_acceleration_is_noisy() -> None:
    seen = readings(PAR, Sensors(pressure=0.0, acceleration=0.3, position_step=1e-4), x=np.linspace(0.0, 1e-2, 1000))
    assert seen["x"] / 1e-4 == pytest.approx(np.round(seen["x"] / 1e-4), abs=1e-9)
    assert np.unique(seen["x"]).size == 101
    assert np.std(seen["a"]) == pytest.approx(0.3, rel=0.1)


def test_each_pressure_sensor_has_its_own_noise_and_hum_of_50_hz() -> None:
    seen = readings(PAR, Sensors(pressure=100.0, pole=0.5, hum=300.0))
    for name in ("p1", "p2", "p_supply"):
        spectrum = 2 * np.abs(np.fft.rfft(seen[name])) / 1000
        assert int(np.argmax(spectrum)) == 50
        assert spectrum[50] == pytest.approx(300.0, rel=0.1)
        assert np.std(seen[name]) == pytest.approx(np.hypot(100.0, 300.0 / 2**0.5), rel=0.1)
    assert abs(np.corrcoef(seen["p1"] - seen["p2"], seen["p_supply"])[0, 1]) < 0.99
    assert Sensors() == Sensors(400.0, 0.0, 0.0, 1e-6, 0.05)


# --- the pipeline file


def pipeline(laboratory: Laboratory, *takes: RecordingPlan) -> dict:
    return tomllib.loads(laboratory.pipeline(takes, "raw"))


def test_a_recording_is_simulated_on_its_own_rig(tmp_path: Path) -> None:
    par = PAR._replace(piston_area_1=8e-4)
    lab = Laboratory("b", par, Sensors(pressure=0.0), vessel_volume=160e-6, supply_recorded=False)
    held = Excitation(np.zeros(5), pressure_1=2e5, pressure_2=2e5, position=0.05)
    lab.record(
        tmp_path, [RecordingPlan("s", "valve", "train", held), RecordingPlan("f", "friction", "test", held)], RNG(1)
    )
    valve, friction = ((tmp_path / f"{n}.csv").read_text().splitlines() for n in "sf")
    assert valve[2] == "t [ms],U_valve [V],P1 [bar]"
    assert friction[2] == "t [ms],P1 [bar],P2 [bar],Pos [mm],Acc [m/s2]"
    assert friction[3].startswith("0.0,0.987,0.987,50.0,")
    assert len(valve) == 8


# --- what is hidden


def test_every_effect_of_the_catalogue_is_hidden_in_its_own_names_and_units() -> None:
    """The truth names the declared parameters, within the declared bounds."""
    assert {e.name for e in CATALOGUE} == set(catalogue())
    facts = rig_quantities(model())
    for effect in CATALOGUE:
        told = effect.true_parameters(effect.apply(Parameters(), 1.0, RNG(4)))
        every = catalogue()[effect.name].parameters
        declared = {p.name: p for p in every if p.value_unrefined in (None, p.null)}  # the others are further laws
        assert set(told) == set(declared)
        for parameter, value in told.items():
            size = declared[parameter].range_on(facts)
            assert size.lower <= value <= size.upper, (effect.name, parameter)


def test_a_rig_hides_nothing_unless_it_is_set_to() -> None:
    plain, absent = Parameters(), {"drop": -1.0}  # a drop of 0 beside Stribeck friction takes its rise from a branch
    for effect in CATALOGUE + UNCATALOGUED:
        for field, null in effect.null_values.items():
            assert getattr(plain, field) == (0.0 if effect.inverse else absent.get(field, null)), field
    assert plain.heat_conductance < 0.0  # a constant temperature
    assert (plain.viscous_asymmetry, plain.cushion_length, plain.load_gap) == (0.0, 0.0, 0.0)


# --- cases


def test_a_refusal_names_the_rigs_on_which_an_effect_is_visible(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'(?s)"stribeck" does not show on the rig "valve".*friction or axis'):
        cases.generate_case(tmp_path, "valve", ["stribeck"], "", 1.0, 1)
    with pytest.raises(InputError, match=r'(?s)no effect "stribek".*an effect that the rig can hide.*stribeck'):
        cases.generate_case(tmp_path, "axis", ["stribek"], "", 1.0, 1)
