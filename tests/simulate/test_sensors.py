"""Sensor effects: readings, true pressures computed from them, and recordings that deviate by noise only."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pneucli.compare import ChannelResult, compare
from pneucli.compare.expected_error import expected_rms
from pneucli.config import load
from pneucli.io.recordings import load_recordings
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import Context
from pneucli.simulate import layout as at
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.kernel.sensors import undo_delay
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import kernel_arguments, kernel_for, run
from pneucli.simulate.valve_forms import ValveArea
from pneucli.stages import ingest

from .synthetic_experiments import RIG, held_commands, make_experiment, model, time_grid

TIME = time_grid(1.0)
AMBIENT = RIG.ambient_pressure
TRUE = 3e5 + 5e4 * np.sin(2 * np.pi * 2.0 * TIME)
SENSORS = {
    "pressure-offset": {"pressure-offset.offset": 12e3},
    "pressure-scale": {"pressure-scale.scale": 1.06},
    "pressure-lag": {"pressure-lag.time_constant": 0.01},
    "time-skew": {"time-skew.delay": 0.012},
}
ALL = {key: value for values in SENSORS.values() for key, value in values.items()}


def read(values: dict[str, float], p1=TRUE, kind="friction", **signals) -> np.ndarray:
    names = sorted({key.partition(".")[0] for key in values})
    return run(model(names, values), make_experiment(kind, TIME, {"p1": p1, "p2": p1, **signals}))


def lagging(p0: float, amplitude: float, omega: float, lag: float) -> np.ndarray:
    """Steady answer of a first-order sensor to p0 + amplitude sin(omega t)."""
    return p0 + amplitude * np.sin(omega * TIME - np.arctan(omega * lag)) / np.hypot(1.0, omega * lag)


READINGS = {
    "pressure-offset": TRUE + 12e3,
    "pressure-scale": AMBIENT + 1.06 * (TRUE - AMBIENT),
    "pressure-lag": lagging(3e5, 5e4, 4 * np.pi, 0.01),
    "time-skew": 3e5 + 5e4 * np.sin(4 * np.pi * (TIME - 0.012)),
}


@pytest.mark.parametrize("name", SENSORS)
def test_true_pressures_are_computed_from_readings(name: str) -> None:
    out = read(SENSORS[name], READINGS[name])
    # a time skew cannot know what was read after the end; a slope over half the lag to each side errs by
    # (omega lag / 2)^2 / 6 of lag omega amplitude
    inner = TIME < 0.98
    assert np.abs(out[:, at.P1] - TRUE)[inner].max() < 1e-3 * 5e4


@pytest.mark.parametrize("name", [*SENSORS, "all"])
def test_reading_the_true_pressures_gives_the_measurement(name: str) -> None:
    measured = READINGS["pressure-lag"]
    out = read(ALL if name == "all" else SENSORS[name], measured)
    inner = (TIME > 0.02) & (TIME < 0.96)
    assert np.abs(out[:, at.R1] - measured)[inner].max() < 1e-3 * 5e4


def test_an_offset_acts_on_p1_and_a_scale_on_both_sensors() -> None:
    offset, scale = read(SENSORS["pressure-offset"], kind="axis"), read(SENSORS["pressure-scale"], kind="axis")
    assert np.all(offset[:, at.R2] == offset[:, at.P2])
    assert scale[:, at.R2] == pytest.approx(AMBIENT + 1.06 * (scale[:, at.P2] - AMBIENT), rel=1e-12)


@pytest.mark.parametrize("name", ["pressure-lag", "time-skew"])
def test_a_sensor_lag_delays_simulated_pressures(name: str) -> None:
    u = held_commands(TIME, (0.0, 2.0, -2.0, 0.0), 0.25)
    e = make_experiment("axis", TIME, {"u": u, "x": 0.1, "p1": 3e5, "p2": 3e5})
    e.flags[at.MECHANICS] = 0.0
    out = run(model([name], SENSORS[name]), e)
    true = out[:, at.P1]
    if name == "time-skew":
        exact = np.interp(TIME - 0.012, TIME, true)
    else:
        fine = np.linspace(0.0, 1.0, 100_001)
        exact = np.empty(fine.size)
        exact[0], seen = true[0], np.interp(fine, TIME, true)
        for k in range(1, fine.size):
            exact[k] = exact[k - 1] + 1e-5 / 0.01 * (seen[k - 1] - exact[k - 1])  # Euler at 10 us
        exact = exact[::100]
    assert np.abs(out[:, at.R1] - exact).max() < 2e-3 * np.ptp(true)
    assert np.abs(out[:, at.R1] - true).max() > 0.02 * np.ptp(true)


def test_at_a_restart_the_sensors_read_what_was_measured() -> None:
    e = make_experiment("axis", TIME, {"p1": TRUE, "p2": TRUE}, restarts=(0, 400, 700))
    out = run(model(list(SENSORS), ALL), e)
    assert out[e.restarts, at.R1] == pytest.approx(TRUE[e.restarts], abs=1e-3 * 5e4)


def chambers(readings: np.ndarray | float, restarts: list[int]):
    """Chambers under known motion and commands, restarted from readings of both pressures."""
    u = held_commands(TIME, (0.0, 2.0, -2.0, 1.0), 0.25)
    signals = {"u": u, "u2": -u, "x": 0.1, "p1": readings, "p2": readings}
    e = make_experiment("axis", TIME, signals, chamber_2="valve", restarts=restarts)
    e.flags[at.MECHANICS] = 0.0
    return e


@pytest.mark.parametrize("name", ["none", *SENSORS, "all"])
def test_no_model_uses_a_pressure_that_is_read_after_its_restart(name: str) -> None:
    """With a delay, a lag or neither, the prediction from 0.4 s on rests on readings up to 0.4 s."""
    values = {"none": {}, "all": ALL}.get(name, SENSORS.get(name, {}))
    readings = 3e5 + 5e4 * np.sin(4 * np.pi * TIME)
    other = np.where(TIME[400] < TIME, readings + 1e5, readings)
    one, another = (
        run(model(sorted({k.partition(".")[0] for k in values}), values), chambers(r, [0, 200, 400]))
        for r in (readings, other)
    )
    assert np.array_equal(one, another)


@pytest.mark.parametrize("name", ["pressure-lag", "time-skew"])
def test_a_true_lag_of_the_sensors_costs_nothing_at_restarts(name: str) -> None:
    """Readings of late sensors, predicted anew every 0.1 s by the model that made them, and by one without the lag."""
    late = model([name], SENSORS[name])
    measured = run(late, chambers(3e5, [0]))[:, at.R1 : at.R2 + 1]
    again = chambers(measured[:, 0], list(range(0, TIME.size, 100)))
    again.inputs[:, at.IN_P2] = measured[:, 1]
    right, wrong = (np.abs(run(one, again)[:, at.R1] - measured[:, 0]).max() for one in (late, model()))
    assert right < 0.01 * wrong
    assert wrong > 5e3


def test_a_biased_accelerometer_adds_its_bias_at_rest_and_in_motion() -> None:
    force = np.where(TIME < 0.2, 0.0, 40.0)
    plain = run(model(), make_experiment("friction", TIME, {"force": force}))
    biased = run(
        model(["acceleration-bias"], {"acceleration-bias.bias": 0.4}),
        make_experiment("friction", TIME, {"force": force}),
    )
    assert biased[:, at.A] == pytest.approx(plain[:, at.A] + 0.4, rel=1e-12)
    assert np.all(biased[:, at.X] == plain[:, at.X])


@pytest.mark.parametrize("delay", [0.003, 0.00345])
def test_undoing_a_delay_keeps_the_noise(delay: float):
    """The mean of two neighbours would have half the power of white noise; along a slope it keeps it to 3 %."""
    noise = np.random.default_rng(1).normal(size=TIME.size)
    inputs = np.zeros((TIME.size, len(at.INPUTS)))
    inputs[:, at.IN_P1] = noise
    true = inputs[:, [at.IN_P1, at.IN_P2]]
    undo_delay(TIME, inputs, at.IN_P1, delay, true, 0)
    assert np.var(true[:-10, 0]) == pytest.approx(np.var(noise), rel=0.03)


def test_a_late_pressure_shows_only_beside_a_command_or_a_motion():
    """In a shut vessel it is the pressure of an earlier start."""
    late, scaled = [catalogue()[name] for name in ("time-skew", "pressure-lag")], catalogue()["pressure-scale"]
    shut = make_experiment("valve", TIME, {"p1": TRUE}, valve_shut=True)
    driven = make_experiment("valve", TIME, {"p1": TRUE, "u": 5.0})
    moved = make_experiment("axis", TIME, {"p1": TRUE, "p2": TRUE, "x": 0.1}, valve_shut=True)
    assert [[e.can_show(one) for one in (*late, scaled)] for e in (shut, driven, moved)] == [
        [False, False, True],
        [True, True, True],
        [True, True, True],
    ]


def test_a_late_recorded_force_drives_the_piston_when_it_acted():
    """With the force 20 ms late the piston starts 20 ms late, but for a model that knows it."""
    acted = 40.0 * (TIME > 0.3) - 60.0 * (TIME > 0.6)
    read = 40.0 * (TIME > 0.32) - 60.0 * (TIME > 0.62)
    true = run(model(), make_experiment("friction", TIME, {"force": acted}))
    late = model(["force-skew"], {"force-skew.delay": 0.02})
    told, untold = (run(one, make_experiment("friction", TIME, {"force": read})) for one in (late, model()))
    moved = np.ptp(true[:, at.X])
    assert np.abs(told[:, at.X] - true[:, at.X]).max() < 0.01 * moved
    assert np.abs(untold[:, at.X] - true[:, at.X]).max() > 0.1 * moved


def test_the_first_pass_of_a_free_run_errs_by_a_tenth_of_what_its_steps_err() -> None:
    values = {"pressure-lag.time_constant": 0.02}
    lag = model(["pressure-lag"], values)
    u = held_commands(TIME, (0.0, 2.0, -2.0, 0.0), 0.25)
    readings: dict[str, np.ndarray | float] = {"u": u, "x": 0.1, "p1": 3e5 + 1e5 * np.sin(20.0 * TIME), "p2": 3e5}
    e = make_experiment("axis", TIME, readings, restarts=(0, 300, 600))
    *given, step, step_of_first_pass = kernel_arguments(kernel_for(lag.effects), lag, e, e.inputs)

    def position(longest: float, longest_given: float) -> np.ndarray:
        out = np.zeros((TIME.size, at.OUTPUTS))
        kernel_for(lag.effects).run(*given, longest, longest_given, np.zeros(1), np.zeros(2), out)
        return out[:, at.X]

    exact, of_first_pass = position(step, step / 8.0), position(step, step_of_first_pass)
    of_steps = position(step / 2.0, step / 8.0)
    assert step_of_first_pass > 2.0 * step
    assert 0.0 < np.abs(of_first_pass - exact).max() < 0.1 * np.abs(of_steps - exact).max()


# --- with the true parameters, recordings of a rig without hidden effects deviate from the model by noise only


FIXTURES = Path(__file__).parents[2] / "fixtures"
TRUTH = json.loads((FIXTURES / "truth.json").read_text())
# of the demo only the axis: what else it has, the others show
RECORDINGS = {"valve_null": "", "friction_null_coulomb": "", "friction_null_stribeck": "", "demo": "axis"}
PRESSURES = ("p1", "p2")
DRAWS = 30  # draws of noise: a break-away that falls otherwise is in one of ten


def true_model(name: str) -> Model:
    """The model with what was set on the rig, its valve by the rig's own law."""
    truth, volume = TRUTH[name]["parameters"], TRUTH[name]["vessel_volume"]
    values = {"friction.coulomb": truth["coulomb"], "friction.viscous": truth["viscous"]}
    if "static" in truth:
        values |= {"stribeck.static": truth["static"], "stribeck.velocity": truth["stribeck_velocity"]}
    if "piston_leak_area" in truth:
        values["piston-leak.area"] = truth["piston_leak_area"]
    if volume:
        values["rig.vessel_volume"] = volume
    effects = tuple(catalogue()[e] for e in (*TRUTH[name]["effects"], *TRUTH[name]["hidden"]))
    second = true_valve(truth, "_2") if "effective_area_2" in truth else None
    return Model(load(FIXTURES / name / "pipeline.toml").to_rig(), effects, values, true_valve(truth), second)


def true_valve(truth: dict[str, float], of: str = "") -> ValveArea:
    """The paths of one chamber: ``of`` is the ending of their names."""
    overlap, most = truth[f"overlap{of}"], truth.get("command_range", 10.0)
    u = most * np.array([0.05, 0.1, 0.2, 0.5, 1.0])
    areas = truth[f"effective_area{of}"] * ((u - overlap) / (most - overlap)) ** truth[f"exponent{of}"]
    return ValveArea((*-u[::-1], *u), (*areas[::-1], *areas), overlap, overlap)


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], list[ChannelResult]]:
    @cache
    def results(name: str) -> list[ChannelResult]:
        path, out = FIXTURES / name / "pipeline.toml", tmp_path_factory.mktemp(name)
        config = load(path)
        ingest.run(Context(path, config, out, out))
        model = true_model(name)
        ready = [
            prepare(r, model.rig, config.compare.horizon)
            for r in load_recordings(out)
            if r.name.startswith(RECORDINGS[name])
        ]
        ends = with_end_stops(ready, model.rig)
        return [r for e in ends for r in compare(model, e, expected_rms(model, e, draws=DRAWS)).results]

    return results


@pytest.mark.parametrize("name", ["valve_null", "demo"])
def test_pressures_of_a_correct_model_deviate_by_their_noise(
    name: str, compared: Callable[[str], list[ChannelResult]]
) -> None:
    ratios = {(r.recording, r.channel): r.ratio_to_noise for r in compared(name) if r.channel in PRESSURES}
    assert len(ratios) >= 5
    assert {where: ratio for where, ratio in ratios.items() if not 0.75 <= ratio <= 1.25} == {}
    assert 0.9 <= np.mean(list(ratios.values())) <= 1.1


def test_motion_of_a_correct_model_deviates_by_its_noise_on_average(
    compared: Callable[[str], list[ChannelResult]],
) -> None:
    results = [r for name in RECORDINGS for r in compared(name) if r.channel not in PRESSURES]
    # a run in which the piston rests throughout has a velocity of 0, and no noise of it
    ratios = [r.ratio_to_noise for r in results if np.isfinite(r.ratio_to_noise)]
    assert len(ratios) > 25
    assert 0.7 <= np.median(ratios) <= 1.2
    assert 0.7 <= np.mean(ratios) <= 1.25
