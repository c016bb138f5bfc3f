"""What a laboratory hands over: takes, files, and a pipeline file that says what a lab would know."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.exam import cases
from pneucli.exam.hidden_effects import BY_NAME, CATALOGUE, UNCATALOGUED
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop, stick_slip, two_sine_reference, valve_staircase, valve_step
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation
from pneucli.figure import named
from pneucli.physics.effects import catalogue
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.synthetic_experiments import model

PAR = Parameters(overlap=0.25, effective_area=2e-6, exponent=1.2)
RNG = np.random.default_rng


# --- manoeuvres


def test_a_step_charges_rests_and_discharges() -> None:
    step = valve_step(PAR, 4.0)
    assert step.command.size == 2600
    assert [step.command[k] for k in (0, 149, 150, 1299, 1300, 1449, 1450, 2599)] == [0, 0, 4, 4, 0, 0, -4, -4]
    assert (step.pressure_1, step.pressure_2) == (PAR.ambient, PAR.ambient)


def test_stairs_go_up_down_and_back_twice() -> None:
    command = valve_staircase(PAR, 0.5, 1.6).command
    assert command.size == 190 + 16 * 90 + 290 + 16 * 90 + 200
    levels = command[np.flatnonzero(np.diff(command, prepend=np.nan) != 0)]
    up = np.array([1, 2, 3, 4, 3, 2, 1, 0, -1, -2, -3, -4, -3, -2, -1, 0])
    assert levels == pytest.approx([0.0, *(0.5 * up), *(1.6 * up)])
    assert np.all(command[190:280] == 0.5)
    assert np.all(command[190 + 1440 + 290 :][:90] == 1.6)
    assert np.array_equal(command, np.round(command, 4))


@pytest.mark.parametrize("rate", [5e3, 12e3])
def test_stick_slip_opens_the_valve_as_far_as_the_rate_needs(rate: float) -> None:
    """The choked flow through that opening (2.46) fills the stuck chamber at the rate (2.47)."""
    par = PAR._replace(dead_volume_added=5e-6)
    move = stick_slip(par, rate)
    (volts,) = set(move.command)
    area = par.effective_area * ((volts - par.overlap) / (10.0 - par.overlap)) ** par.exponent
    flow = 0.484 * area * par.supply * np.sqrt(2.0 / (287.0 * par.temperature))
    assert 1.4 * 287.0 * par.temperature * flow / (35e-6 + par.piston_area_1 * 0.03) == pytest.approx(rate)
    assert (move.command.size, move.position, move.chamber_2_open) == (5000, 0.03, True)
    assert (move.pressure_1, move.pressure_2) == (par.ambient, par.ambient)


def test_a_closed_loop_begins_in_balance_on_its_reference() -> None:
    par = PAR._replace(piston_area_1=8e-4, piston_area_2=6e-4)
    move = closed_loop(par, np.array([0.12, 0.13]), 150.0, 1.5e5)
    assert (move.position, move.gain, move.chamber_2_open, move.velocity) == (0.12, 150.0, False, 0.0)
    assert move.pressure_1 == par.ambient + 1.5e5
    assert 8e-4 * (move.pressure_1 - par.ambient) == pytest.approx(6e-4 * (move.pressure_2 - par.ambient))


def test_a_load_toward_zero_is_carried_by_chamber_1() -> None:
    par = PAR._replace(piston_area_1=8e-4, piston_area_2=6e-4)
    assert stick_slip(par, 5e3, load=40.0).pressure_1 == pytest.approx(par.ambient + 40.0 / 8e-4)
    move = closed_loop(par, np.array([0.12]), 150.0, 1.5e5, load=40.0)
    assert 8e-4 * (move.pressure_1 - par.ambient) == pytest.approx(6e-4 * (move.pressure_2 - par.ambient) + 40.0)
    assert closed_loop(par, np.array([0.12]), 150.0, 1.5e5, load=1e3).pressure_2 == par.ambient


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


def test_a_lag_is_exact_for_a_ramp_and_at_rest_before() -> None:
    """A lag T of r t is r (t - T (1 - exp(-t/T)))."""
    time = 1e-3 * np.arange(1000)
    seen = readings(PAR._replace(pressure_lag=0.02), QUIET, p1=PAR.ambient + 1e5 + 2e5 * time)["p1"]
    assert seen == pytest.approx(1e5 + 2e5 * (time - 0.02 * (1 - np.exp(-time / 0.02))))


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


# --- files


# --- the pipeline file


STEP, SLIP = valve_step(PAR, 4.0), stick_slip(PAR, 5e3)
MOVE = closed_loop(PAR, np.full(10, 0.1), 150.0, 1e5)


def pipeline(laboratory: Laboratory, *takes: RecordingPlan) -> dict:
    return tomllib.loads(laboratory.pipeline(takes, "raw"))


def test_commands_of_a_slower_controller_have_stamps_of_their_own() -> None:
    take = RecordingPlan("s", "valve", "train", STEP)
    usual, slow = (
        pipeline(Laboratory("r", PAR, Sensors(), vessel_volume=1e-4, command_cycle=n), take)["signals"] for n in (1, 5)
    )
    stamps = {"time": {"column": "t_cmd [ms]", "unit": "ms"}, "hold": True}
    assert slow == usual | {"u": usual["u"] | stamps}


def test_a_rig_with_everything_says_everything() -> None:
    par = PAR._replace(piston_area_1=8.1e-4, piston_area_2=7.3e-4, dead_volume_1=31e-6, dead_volume_2=32e-6, mass=2.5)
    lab = Laboratory(
        "rig-1", par, Sensors(), vessel_volume=160e-6, linear_valve=True, effects=("stribeck", "valve-lag")
    )
    said = pipeline(
        lab,
        RecordingPlan("s", "valve", "train", STEP),
        RecordingPlan("f", "friction", "test", SLIP),
        RecordingPlan("m", "axis", "test", MOVE),
    )
    assert said["pipeline"] == {"name": "rig-1"}
    assert said["rig"] == {
        "gas_temperature": "293.15 K",
        "ambient_pressure": "1.013 bar",
        "supply_pressure": "7.0130 bar",
        "cylinder": {
            "piston_area_1": "8.1000 cm^2",
            "piston_area_2": "7.3000 cm^2",
            "stroke": "200.0 mm",
            "dead_volume_1": "31.000 cm^3",
            "dead_volume_2": "32.000 cm^3",
            "moving_mass": "2.5000 kg",
        },
        "vessel": {"volume": "160.000 cm^3"},
    }
    gauge = {"unit": "bar", "reference": "gauge"}
    assert said["signals"] == {
        "time": {"column": "t [ms]", "unit": "ms"},
        "u": {"column": "U_valve [V]", "unit": "V"},
        "p_supply": {"column": "P_supply [bar]"} | gauge,
        "p1": {"column": "P1 [bar]"} | gauge,
        "p2": {"column": "P2 [bar]"} | gauge,
        "x": {"column": "Pos [mm]", "unit": "mm"},
        "a": {"column": "Acc [m/s2]", "unit": "m/s^2"},
    }
    assert said["recordings"] == [
        {
            "name": "s",
            "file": "raw/s.csv",
            "experiment": "valve",
            "use": "train",
            "take": ["time", "u", "p_supply", "p1"],
        },
        {"name": "f", "file": "raw/f.csv", "experiment": "friction", "use": "test", "chamber_2": "open"},
        {"name": "m", "file": "raw/m.csv", "experiment": "axis", "use": "test", "chamber_2": "closed"},
    ]
    assert said["model"] == {"effects": ["stribeck", "valve-lag"], "valve": "linear"}
    assert said["compare"] == {"horizon": "0.5 s"}


def test_a_valve_test_file_has_no_cylinder_and_no_unrecorded_supply() -> None:
    lab = Laboratory("b", PAR, Sensors(), vessel_volume=160e-6, has_cylinder=False, supply_recorded=False)
    said = pipeline(lab, RecordingPlan("s", "valve", "train", STEP))
    assert "cylinder" not in said["rig"]
    assert list(said["signals"]) == ["time", "u", "p1"]
    assert said["recordings"][0]["take"] == ["time", "u", "p1"]
    assert said["model"] == {"effects": []}
    assert said["compare"] == {"horizon": "5 s"}
    assert (
        "vessel" not in pipeline(Laboratory("f", PAR, Sensors()), RecordingPlan("f", "friction", "test", SLIP))["rig"]
    )


def test_the_bench_has_the_vessel_and_not_the_cylinders_faults() -> None:
    leaks = {"leak_area": 2e-8, "laminar_conductance": 1e-12, "relief_growth": 1e-13}
    par = PAR._replace(dead_volume_added=1e-6, piston_leak_area=1e-8, load_mass=1.0, **leaks)
    on_rig = Laboratory("b", par, Sensors(), vessel_volume=160e-6).valve_test_rig()
    alone = Laboratory("b", par, Sensors(), vessel_volume=160e-6, has_cylinder=False).valve_test_rig()
    for bench in (on_rig, alone):
        assert (bench.piston_area_1, bench.piston_area_2, bench.dead_volume_1) == (0.0, 0.0, 160e-6)
        assert (bench.dead_volume_added, bench.piston_leak_area, bench.load_mass) == (0.0, 0.0, 0.0)
    assert named(on_rig, " ".join(leaks)) == dict.fromkeys(leaks, 0.0)
    assert named(alone, " ".join(leaks)) == leaks
    assert Laboratory("b", par, Sensors()).valve_test_rig().dead_volume_1 == 0.0


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


DRAWS = 300
BETWEEN = {  # least and most at full size: within 25 % of the centre, or as its own function draws
    "chamber-leak": {"leak_area": (2.25e-8, 3.75e-8)},
    "friction-asymmetry": {"asymmetry": (0.1875, 0.3125), "viscous_asymmetry": (0.1875, 0.3125)},
    "stribeck": {"static": (1.6 * 15.0, 2.1 * 15.0), "stribeck_velocity": (0.01, 0.025)},
    "position-friction": {"position_from": (0.06, 0.12), "position_gain": (1.0, 1.8)},
    "spring-force": {"spring_stiffness": (150.0, 300.0), "spring_rest": (0.03, 0.17)},
    "extra-mass": {"extra_mass": (0.4 * 2.0, 0.8 * 2.0)},
}


def drawn(name: str, field: str) -> np.ndarray:
    rng = RNG(3)
    return np.array([getattr(BY_NAME[name].apply(Parameters(), 1.0, rng), field) for _ in range(DRAWS)])


@pytest.mark.parametrize("name", BETWEEN)
def test_a_hidden_effect_is_drawn_within_its_range_and_with_either_sign_where_it_has_two(name: str) -> None:
    for field, (low, high) in BETWEEN[name].items():
        sizes = drawn(name, field)
        assert (len(set(np.sign(sizes))) == 2) == (name == "friction-asymmetry")
        sizes = np.abs(sizes)
        assert low <= sizes.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < sizes.max() <= high


def test_scales_and_patches_are_drawn_around_their_base_values() -> None:
    scale = drawn("pressure-scale", "pressure_scale") - 1.0
    assert 0.04 <= np.abs(scale).min() < 0.045
    assert 0.075 < np.abs(scale).max() <= 0.08
    assert set(np.sign(scale)) == {-1.0, 1.0}
    width = drawn("position-friction", "position_to") - drawn("position-friction", "position_from")
    assert 0.015 <= width.min() < 0.017
    assert 0.028 < width.max() <= 0.03


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


def test_units_of_the_catalogue_are_not_always_the_rigs() -> None:
    assert BY_NAME["valve-deadband"].true_parameters(Parameters(overlap=0.5)) == {"width": 1.0}
    assert BY_NAME["pressure-friction"].true_parameters(Parameters(pressure_gain=2e-6)) == {"gain": pytest.approx(0.2)}


# --- cases


def test_a_refusal_names_the_rigs_on_which_an_effect_is_visible(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'(?s)"stribeck" does not show on the rig "valve".*friction or axis'):
        cases.generate_case(tmp_path, "valve", ["stribeck"], "", 1.0, 1)
    with pytest.raises(InputError, match=r'(?s)no effect "stribek".*an effect that the rig can hide.*stribeck'):
        cases.generate_case(tmp_path, "axis", ["stribek"], "", 1.0, 1)


def test_half_of_the_pistons_have_a_rod() -> None:
    rigs = [cases.draw_rig("axis", False, RNG(seed)) for seed in range(200)]
    shares = np.array([rig.piston_area_2 / rig.piston_area_1 for rig in rigs])
    rods = shares[shares < 1.0 - 1e-9]
    assert 0.3 < rods.size / shares.size < 0.7
    assert 0.85 <= rods.min() < rods.max() <= 0.9


def test_half_of_the_benches_hum() -> None:
    hums = np.array([cases._mains_hum(RNG(seed)) for seed in range(200)])
    loud = hums[hums > 0.0]
    assert 0.35 < loud.size / hums.size < 0.65
    assert 140.0 <= loud.min() < 147.0
    assert 193.0 < loud.max() <= 200.0


def handed_over(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: str, hidden: list[str], seed: int = 1, size: float = 1.0
) -> Laboratory:
    """The laboratory of a case, nothing recorded."""
    seen: list[Laboratory] = []
    monkeypatch.setattr(Laboratory, "record", lambda self, raw, takes, rng: seen.append(self))
    folder.mkdir(exist_ok=True)
    cases.generate_case(folder, kind, hidden, "", size, seed)
    return seen[0]


def test_the_rig_of_a_case_has_what_is_hidden_in_its_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    full, half = (handed_over(tmp_path, monkeypatch, "axis", ["chamber-leak"], size=s) for s in (1.0, 0.5))
    assert 0.75 * 3e-8 <= full.parameters.leak_area <= 1.25 * 3e-8
    assert half.parameters.leak_area == pytest.approx(0.5 * full.parameters.leak_area)
    assert full.name == tmp_path.name


def test_cases_differ_as_laboratories_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    labs = [handed_over(tmp_path, monkeypatch, "axis", ["chamber-leak"], seed) for seed in range(60)]
    assert {lab.sensors.pressure for lab in labs} == {250.0, 400.0, 800.0}
    assert {lab.sensors.pole for lab in labs} == {0.0, 0.5, 0.8}
    assert 0.05 < np.mean([lab.linear_valve for lab in labs]) < 0.3
    assert 0.1 < np.mean([lab.effects == ("stribeck",) for lab in labs]) < 0.45
    assert 0.65 < np.mean([lab.supply_recorded for lab in labs]) < 0.97
    assert all((lab.vessel_volume is None) == lab.linear_valve for lab in labs)
    vessels = [lab.vessel_volume for lab in labs if lab.vessel_volume]
    assert 120e-6 <= min(vessels) < 140e-6
    assert 230e-6 < max(vessels) <= 250e-6
    for lab in labs:
        assert (lab.parameters.static > lab.parameters.coulomb) == (lab.effects == ("stribeck",))
        assert lab.has_cylinder


def test_the_rig_satisfies_what_a_hidden_effect_needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(8):
        assert handed_over(tmp_path, monkeypatch, "axis", ["valve-deadband"], seed).linear_valve
        assert not handed_over(tmp_path, monkeypatch, "axis", ["supply-droop"], seed).supply_recorded
        assert handed_over(tmp_path, monkeypatch, "axis", ["stribeck"], seed).effects == ()
    friction, valve = (handed_over(tmp_path, monkeypatch, kind, []) for kind in ("friction", "valve"))
    assert (friction.vessel_volume, friction.linear_valve, friction.effects) == (None, False, ())
    assert (valve.has_cylinder, valve.linear_valve) == (False, False)
    assert valve.vessel_volume is not None
