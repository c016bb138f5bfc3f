"""One check at a time, on a recording that is implausible in nothing else."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.noise import NoiseModel
from pneucli.plausibility import findings
from pneucli.plausibility.blocks import Blocks, fit_linear, resolved_blocks
from pneucli.plausibility.detectors.forces import ClosedChamber
from pneucli.plausibility.rig_check import RigCheck, is_inactive
from pneucli.recording import Calibration, Recording, Rig

from .worlds import FIXTURES, SHARED, at_rate, read, world_pipelines

T = np.arange(4000) * 1e-3
RNG = np.random.default_rng(0)
NOISE = {"p1": 100.0, "p2": 100.0, "p_supply": 100.0, "x": 1e-6, "force": 0.1, "temperature": 0.1, "u": 0.0}
CYLINDER = Rig(piston_area_1=8e-4, piston_area_2=8e-4, dead_volume_1=3e-5, dead_volume_2=3e-5, stroke=0.2)
SWING = 0.1 + 0.05 * np.sin(3 * T)  # m
SLOW = 2e5 + 1e5 * np.sin(T)  # Pa


def recorded(experiment: Any = "friction", chamber_2: Any = None, imposed: Any = None, **signals: Any) -> Recording:
    noisy = {n: values + NOISE[n] * RNG.standard_normal(T.size) for n, values in signals.items()}
    models = {name: NoiseModel(NOISE[name]) for name in signals}
    return Recording("one", experiment, "train", T, noisy, models, chamber_2=chamber_2, imposed=imposed)


def seen(one: Recording, rig: Rig = CYLINDER) -> dict[tuple[str, str], str]:
    return {(f.check, f.signal): f.found for f in findings([one], rig, {})}


def test_a_supply_that_is_off_while_a_chamber_is_vented_is_no_unit() -> None:
    off = recorded("valve", u=T, p1=SLOW, p_supply=1.02e5 + 0 * T)
    assert ("unit", "p_supply") not in seen(off, Rig(vessel_volume=1e-3))


def closed(x: np.ndarray) -> np.ndarray:
    return np.asarray(3e5 * (1.1e-4 / (3e-5 + 8e-4 * (0.2 - x))) ** 1.4)


@pytest.mark.parametrize(
    ("one", "pair", "words"),
    [
        (recorded(p1=0.2e5 + 0 * T), ("reference", "p1"), "absolute or less for a quarter of the time: gauge?"),
        (recorded(p1=2.5e5 + 2.55e5 * np.sin(T * 7)), ("reference", "p1"), "absolute: gauge?"),
        (recorded(p1=2.5e5 + 4.5e5 * np.sin(T * 7) ** 9), ("reference", "p1"), "below vacuum"),
        (recorded(p1=60e5 + SLOW), ("unit", "p1"), "more than pneumatic supplies have (50 bar)"),
        (recorded(chamber_2="open", p2=2.02e5 + 0 * T), ("reference", "p2"), "2.02 bar in an open chamber: absolute?"),
        (recorded(chamber_2="open", p2=4e5 + 0 * T), ("swapped", "p2"), "4 bar in an open chamber"),
        (recorded(temperature=20 + T), ("unit", "temperature"), "stays between"),
        (recorded(u=200 * T), ("unit", "u"), "792 V, more than"),
        (
            recorded("valve", u=T, p1=1.02e5 + 0 * T, p_supply=1.02e5 + 0 * T),
            ("unit", "p_supply"),
            "hardly differs from",
        ),
        (recorded(x=SWING, p1=3e5 + 0 * T), ("silent", "p1"), "the piston moves, and p1 stays at 3 bar"),
        (
            recorded(x=SWING, chamber_2="closed", p1=SLOW, p2=3e5 + 0 * T),
            ("silent", "p2"),
            "while x would change it by",
        ),
        (recorded(x=0.8 * SWING + 0.06 * (T > 2)), ("speed", "x"), "x jumps once, first by 60.1 mm in 1 ms at 2.001 s"),
        (recorded(x=5 * SWING), ("stroke", "x"), "from 250 mm to 750 mm"),
        (recorded("axis", "open", x=SWING - 0.3), ("stroke", "x"), "from −250 mm to −150 mm"),
        (
            recorded(x=0.2 - SWING, chamber_2="closed", p1=closed(SWING), p2=closed(SWING)),
            ("direction", "x"),
            "falls where x grows",
        ),
    ],
)
def test_only_what_is_wrong_is_found(one: Recording, pair: tuple[str, str], words: str) -> None:
    found = seen(one, Rig(**{**vars(CYLINDER), "supply_pressure": 7e5}))
    assert list(found) == [pair]
    assert words in found[pair]


def test_a_chamber_of_an_axis_is_not_filled_above_its_supply() -> None:
    """Gas that flows in comes from somewhere; a load may press a chamber above the supply, while it shrinks."""
    rig = replace(CYLINDER, supply_pressure=7e5)
    one = recorded("axis", "open", x=SWING, u=np.sin(T), p1=9e5 + SLOW)
    assert "from a supply of 7 bar" in seen(one, rig)["supply", "p1"]
    pressed = recorded("axis", "open", x=SWING, u=np.sin(T), p1=6e5 - 5e5 * np.sin(3 * T))
    assert ("supply", "p1") not in seen(pressed, rig)


def test_counts_of_a_coarse_encoder_at_a_high_rate_are_no_jumps() -> None:
    time = np.arange(4000) * 1e-5
    x = 0.1 + np.round(0.05 * np.sin(30 * time) / 5e-4) * 5e-4
    one = Recording("one", "friction", "train", time, {"x": x}, {"x": NoiseModel(0.0, step=5e-4)})
    assert seen(one) == {}


def test_a_closed_chamber_as_it_is_stated_is_plausible() -> None:
    assert seen(recorded(x=SWING, chamber_2="closed", p1=closed(SWING), p2=closed(SWING))) == {}


def test_a_piston_is_not_faster_than_air() -> None:
    found = seen(recorded(x=500 * SWING), Rig(piston_area_1=8e-4))
    assert list(found) == [("unit", "x"), ("speed", "x")]
    assert "faster than any piston (30000 mm/s)" in found["speed", "x"]


def charge(end: float, supply: float, start: float = 1.0e5) -> Recording:
    """Chamber 1 goes from ``start`` to ``end`` within the last 0.8 s, at a command of 5 V or -5 V."""
    late = np.maximum(T - 3.2, 0.0)
    p = start + (end - start) * (1 - np.exp(-late / 0.1))
    u = np.where(late > 0, 5.0 * np.sign(end - start), 0.0)
    return recorded("valve", p1=p, u=u, p_supply=supply + 0 * T)


def test_a_vented_chamber_rests_at_ambient_pressure() -> None:
    found = seen(charge(0.02e5, 7e5, start=6e5))
    assert list(found) == [("reference", "p1")]
    assert "bar in a vented chamber: gauge?" in found["reference", "p1"]
    assert seen(charge(1.02e5, 7e5, start=6e5)) == {}


def test_an_ejector_draws_a_chamber_below_ambient_pressure() -> None:
    """From ambient to 0.25 bar by a command that opens to 0.2 bar, and back: nothing is odd, but on a usual rig."""
    cycle = np.where(T < 2.0, np.exp(-T / 0.3), 1.0 - np.exp(-(T - 2.0) / 0.3))
    one = recorded("valve", p1=0.25e5 + 0.763e5 * cycle, u=np.where(T < 2.0, 5.0, -5.0), p_supply=0.2e5 + 0 * T)
    vessel = Rig(vessel_volume=1e-4)
    assert seen(one, vessel)
    assert seen(one, replace(vessel, source="ejector")) == {}


def test_a_chamber_is_charged_from_above() -> None:
    rising = recorded("valve", p1=6e5 - 5e5 * np.exp(-T), u=5 + 0 * T, p_supply=2e5 + 0 * T)
    vessel = Rig(vessel_volume=1e-4)
    assert list(seen(rising, vessel)) == [("supply", "p_supply")]
    assert seen(recorded("valve", p1=6e5 - 5e5 * np.exp(-T), u=5 + 0 * T, p_supply=8e5 + 0 * T), vessel) == {}


def test_the_chamber_of_a_cylinder_is_charged_from_the_stated_supply() -> None:
    """Where no supply was recorded the stated one counts: it charges the chamber to 6 bar, and is 2 bar or 8 bar."""
    rising = recorded("axis", p1=6e5 - 5e5 * np.exp(-T), p2=2e5 + 0 * T, x=0.1 + 0 * T, u=5 + np.sin(T))
    cylinder = {**vars(CYLINDER)}
    assert ("supply", "p1") in seen(rising, Rig(**{**cylinder, "supply_pressure": 2e5}))
    assert ("supply", "p1") not in seen(rising, Rig(**{**cylinder, "supply_pressure": 8e5}))


def test_surroundings_are_those_of_a_laboratory() -> None:
    one = recorded(p1=SLOW)
    assert ("rig", "p1") in seen(one, Rig(ambient_pressure=1013e5))
    assert ("rig", "temperature") in seen(one, Rig(gas_temperature=20.0))
    assert seen(one, Rig()) == {}


def test_one_spool_vents_port_2_where_it_fills_port_1() -> None:
    p = 4e5 + 2e5 * np.sin(3 * T)  # charged while its slope is positive
    u = 5 + 4 * np.cos(3 * T)
    one = recorded("valve", p1=p, u=u, p_supply=9e5 + 0 * T)
    other = replace(recorded("valve", p1=p, u=10 - u, p_supply=9e5 + 0 * T), chamber=2)
    spool = Rig(vessel_volume=1e-4, valve_arrangement="5/3", valve_null=5.0)
    two = replace(spool, valve_arrangement="two")
    assert seen(one, spool) == seen(other, spool) == seen(one, two) == {}
    assert "port 2 is filled" in seen(replace(one, chamber=2), spool)["direction", "u"]
    assert "chamber 1 is vented" in seen(replace(other, chamber=1), spool)["direction", "u"]


@pytest.mark.parametrize(("also", "where"), [(True, "[signals] u"), (False, "[recordings.signals] u of discharge")])
def test_a_command_is_reversed_in_the_recordings_that_show_it(also: bool, where: str) -> None:
    """A log of discharges may hold the command without its sign, while those of charges are right."""
    p = 4e5 + 2e5 * np.sin(3 * T)
    reversed_u = 5 - 4 * np.cos(3 * T)
    recordings = [
        replace(recorded("valve", p1=p, u=u, p_supply=9e5 + 0 * T), name=name)
        for name, u in (("discharge", reversed_u), ("charge", reversed_u if also else 10 - reversed_u))
    ]
    found = findings(recordings, Rig(vessel_volume=1e-4, valve_null=5.0), {})
    assert [(one.recording, one.check) for one in found] == [("discharge", "direction"), ("charge", "direction")][
        : 1 + also
    ]
    assert f"write scale = -1.0 in {where}" in found[0].mend


def regulated(level: float, start: float, u: float) -> Recording:
    """A vessel that goes from one pressure (Pa) to another at 1 s and rests there."""
    late = np.maximum(T - 1, 0)
    p = level + (start - level) * np.exp(-late / 0.05)
    return recorded("valve", p1=p, u=np.where(late > 0, u, 5.0), p_supply=7e5 + 0 * T)


def loop_findings(*ones: Recording) -> dict[tuple[str, str], str]:
    rig = Rig(vessel_volume=1e-4)
    return {(f.check, f.signal): f.found for f in findings(list(ones), rig, {})}


def test_a_vessel_that_rests_where_the_command_says_is_at_a_pressure_loop() -> None:
    """0.5 bar for each volt, from above and from below; without one from below a leak could do it."""
    rising = [regulated(1e5 + 0.5e5 * u, 3.5e5, u) for u in (6.0, 8.0)]
    falling = [regulated(1e5 + 0.5e5 * u, 3.5e5, u) for u in (4.0, 2.0)]
    found = loop_findings(*rising, *falling)
    assert list(found) == [("pressure-loop", "u")]
    assert "between 2 bar and 5 bar, 0.5 bar for each volt" in found["pressure-loop", "u"]
    assert ("pressure-loop", "u") not in loop_findings(*rising, regulated(4.5e5, 3.5e5, 7.0))


def test_steps_to_both_sides_of_a_middle_show_a_pressure_loop() -> None:
    def steps(volts: float) -> Recording:
        late = (T > 1.0, T > 2.5)
        u = 5.0 + volts * late[0] - 2.0 * volts * late[1]
        gone = (1 - np.exp(-np.maximum(T - 1.0, 0) / 0.05)) - 2.0 * (1 - np.exp(-np.maximum(T - 2.5, 0) / 0.05))
        return recorded("valve", p1=3.5e5 + 0.5e5 * volts * gone, u=u, p_supply=7e5 + 0 * T)

    assert list(loop_findings(steps(1.0), steps(2.0), steps(4.0))) == [("pressure-loop", "u")]


def test_rests_that_do_not_follow_the_command_are_no_pressure_loop() -> None:
    ones = [regulated(level, 3.5e5, u) for level, u in ((4e5, 6.0), (2.4e5, 8.0), (3e5, 4.0), (5e5, 2.0))]
    assert ("pressure-loop", "u") not in loop_findings(*ones)


def test_a_stated_supply_wins_over_what_supplies_usually_have() -> None:
    one = recorded(p1=52e5 + SLOW)
    assert ("unit", "p1") in seen(one)
    assert seen(one, replace(CYLINDER, supply_pressure=52.7e5)) == {}


@pytest.mark.parametrize(("shift", "weight"), [(-0.07, "doubt"), (-0.1, "contradiction"), (0.1, "contradiction")])
def test_a_position_that_leaves_a_chamber_no_volume_contradicts_the_file(shift: float, weight: str) -> None:
    """The dead volumes are worth 37.5 mm: what x states beyond them no gas can fill."""
    (found,) = findings([recorded("axis", "open", x=SWING + shift)], CYLINDER, {})
    assert (found.check, found.weight) == ("stroke", weight)
    assert ("less than no volume" in found.found) == (weight == "contradiction")


def test_where_x_is_zero_does_not_matter_to_a_force() -> None:
    """A slide over a load cell counts x from the middle; a chamber of an axis has a volume there."""
    assert seen(recorded(x=SWING - 0.1, force=5 * np.sign(np.cos(3 * T)) + 3 * np.cos(3 * T))) == {}
    assert ("stroke", "x") in seen(recorded("axis", "open", x=SWING - 0.1))


def flowing(u: np.ndarray, seconds: float = 0.2, supply: float = 7e5, ambient: float = 1.013e5) -> np.ndarray:
    """A vessel at 1 kHz that fills (u > 0) or vents (u < 0), choked below half the pressure upstream.

    At 10 V and choked its pressure goes by that upstream in ``seconds``.
    """
    p = np.full(u.size, ambient)
    for k in range(1, u.size):
        up, down = (supply, p[k - 1]) if u[k - 1] > 0 else (p[k - 1], ambient)
        flow = np.sqrt(1.0 - min(1.0, max(0.0, 2.0 * down / up - 1.0)) ** 2)
        p[k] = p[k - 1] + 1e-3 * u[k - 1] / 10.0 * up * flow / seconds
    return p


FIVE_OPENINGS = np.where(T % 0.8 < 0.6, 2.0 * (1 + T // 0.8), -10.0)  # most of the time the vessel is full or empty
VESSEL = Rig(vessel_volume=2e-3, supply_pressure=7e5)


def test_a_charge_test_has_to_do_with_its_command() -> None:
    assert seen(recorded("valve", u=FIVE_OPENINGS, p1=flowing(FIVE_OPENINGS)), VESSEL) == {}
    late = np.roll(FIVE_OPENINGS, 40)
    assert seen(recorded("valve", u=FIVE_OPENINGS, p1=flowing(late)), VESSEL) == {}


@pytest.mark.parametrize("seconds", [0.02, 0.05, 0.1, 0.2])
def test_commands_to_a_full_vessel_tell_nothing(seconds: float) -> None:
    """It fills once, and stays full whatever opening follows."""
    u = np.where(T < 0.5, 0.0, np.repeat(np.random.default_rng(1).uniform(1.0, 10.0, 40), 100))
    assert seen(recorded("valve", u=u, p1=flowing(u, seconds)), VESSEL) == {}


def test_a_charge_test_of_a_piston_on_its_stop_has_to_do_with_its_command() -> None:
    one = recorded("axis", "open", u=FIVE_OPENINGS, p1=flowing(FIVE_OPENINGS, 0.02), x=0 * T)
    moved = replace(recorded("axis", "open", u=np.sin(T), p1=SLOW, x=SWING), name="moved")
    rig = replace(CYLINDER, supply_pressure=7e5)
    assert [f for f in findings([one, moved], rig, {}) if f.recording == "one"] == []


def test_a_compressor_that_switches_has_to_do_with_the_pressure() -> None:
    """It fills at 1.6 bar/s while it runs, and a consumer takes half as much, more at a higher pressure."""
    p, u = np.full(T.size, 6e5), np.zeros(T.size)
    for k in range(1, T.size):
        u[k] = 5.0 if p[k - 1] < 5.8e5 else 0.0 if p[k - 1] > 6.2e5 else u[k - 1]
        p[k] = p[k - 1] + 1e-3 * (1.6e5 * u[k] / 5.0 - 0.8e5 * p[k - 1] / 6e5)
    assert seen(recorded("valve", u=u, p1=p), Rig(vessel_volume=2e-3)) == {}


def test_a_command_of_another_valve_has_nothing_to_do_with_the_flow() -> None:
    other = 3.0 * RNG.standard_normal(T.size)
    assert ("silent", "u") in seen(recorded("valve", u=other, p1=flowing(FIVE_OPENINGS)), VESSEL)


def test_a_full_vessel_stays_full_at_a_command_to_fill_it() -> None:
    """And one that is empty stays empty at a command to vent it; at any other pressure the sensor is dead."""
    filled, vented = 5.0 * (T > 1), -5.0 * (T > 1)
    for u, level, is_silent in ((filled, 7e5, False), (vented, 1.013e5, False), (filled, 3e5, True)):
        one = recorded("valve", u=u, p1=level + 0 * T)
        assert (("silent", "p1") in seen(one, VESSEL)) == is_silent


@pytest.mark.parametrize(("depth", "weight"), [(0.05e5, None), (0.2e5, "doubt"), (0.9e5, "contradiction")])
def test_a_pressure_below_vacuum_weighs_by_its_uncertainty(depth: float, weight: str | None) -> None:
    """1 % of 5 bar is a sensor's usual zero; a stated calibration counts instead."""
    one = recorded(chamber_2="closed", p2=2.5e5 - depth + 2.5e5 * np.sin(7 * T))
    found = [f for f in findings([one], Rig(), {}) if "below vacuum" in f.found]
    assert [f.weight for f in found] == ([weight] if weight else [])
    (sure,) = findings([one], Rig(), {}, {"p2": Calibration(zero=500.0)})
    assert sure.weight == "contradiction"
    assert sure.excess > 6.0


def filling(*commands: float, hold: int = 200, jump: float = 0.0) -> Recording:
    """A vessel that a valve fills and vents by turns; ``jump`` is added to p1 from the middle on, in Pa."""
    u = np.repeat(commands, hold)[: T.size]
    p = 3e5 + np.cumsum(400.0 * u) * 1.0
    p = 3e5 + 1.5e5 * np.tanh((p - 3e5) / 1.5e5) + jump * (np.arange(u.size) >= u.size // 2)
    noisy = p + 100.0 * RNG.standard_normal(u.size)
    return Recording("one", "valve", "train", T[: u.size], {"u": u, "p1": noisy}, {"p1": NoiseModel(100.0)})


def test_a_pressure_that_jumps_from_one_run_to_another_is_seen_and_filling_is_not() -> None:
    commands = [3.0, -2.0, 4.0, -5.0] * 5
    vessel = Rig(vessel_volume=1.6e-4, supply_pressure=7e5)
    assert "two runs after one another?" in seen(filling(*commands, jump=0.4e5), vessel)["jumps", "p1"]
    assert ("jumps", "p1") not in seen(filling(*commands), vessel)
    fast = filling(*commands, hold=20)  # each command fills the vessel within a sample or two
    stepped = Recording("one", "valve", "train", fast.time, {"u": fast["u"], "p1": 3e5 + 4e4 * fast["u"]}, fast.noise)
    assert ("jumps", "p1") not in seen(stepped, vessel)


def test_a_command_that_chatters_between_samples_is_seen_and_a_test_signal_is_not() -> None:
    vessel = Rig(vessel_volume=1.6e-4, supply_pressure=7e5)
    rng = np.random.default_rng(5)
    chattering = filling(*np.where(rng.random(4000) < np.linspace(0.1, 0.9, 4000), 6.0, -6.0), hold=1)
    assert "of its levels last one sample" in seen(chattering, vessel)["sampling", "u"]
    for hold in (3, 10, 100):  # random binary commands, each held for some samples
        assert ("sampling", "u") not in seen(filling(*rng.choice([-6.0, 6.0], 4000 // hold), hold=hold), vessel)
    smooth = filling(*(6.0 * np.sin(9 * T)), hold=1)
    assert ("sampling", "u") not in seen(smooth, vessel)


def swinging(turns: float, noise: float = 0.0) -> Recording:
    """Return a light piston in its cylinder, logged slowly while it swings by ``turns`` radians a sample."""
    x = 0.1 + 0.01 * np.sin(turns * np.arange(400.0)) + noise * RNG.standard_normal(400)
    signals = {"u": np.zeros(400), "p1": np.full(400, 3e5), "p2": np.full(400, 3e5), "x": x}
    return Recording("one", "axis", "train", 0.1 * np.arange(400.0), signals, {"x": NoiseModel(max(noise, 1e-6))})


def test_a_slow_log_of_a_piston_is_odd_only_where_the_piston_is_seen_to_turn_between_samples() -> None:
    light = replace(CYLINDER, moving_mass=0.5)
    assert ("sampling", "time") in seen(swinging(1.2), light)
    assert ("sampling", "time") not in seen(swinging(0.8), light)
    assert ("sampling", "time") not in seen(swinging(0.01, noise=1e-3), light)  # its noise turns, it does not


def steady_bench(upstream: np.ndarray, downstream: np.ndarray, flow: np.ndarray) -> Recording:
    signals = {"p_supply": upstream, "p1": downstream, "flow": flow}
    models = {"p_supply": NoiseModel(100.0), "p1": NoiseModel(100.0), "flow": NoiseModel(1e-6)}
    return Recording("one", "flow", "train", np.arange(float(flow.size)), signals, models)


def test_gas_on_a_steady_bench_flows_toward_the_lower_pressure() -> None:
    """A pump moves it the other way, but the less the higher the pressure is; exchanged columns show the opposite."""
    upstream, downstream = np.full(9, 7e5), np.linspace(6.9e5, 3e5, 9)
    valve = 1e-3 * np.sqrt(1.0 - downstream / upstream)
    assert seen(steady_bench(upstream, downstream, valve)) == {}
    assert list(seen(steady_bench(downstream, upstream, valve))) == [("flow-direction", "flow")]
    assert seen(steady_bench(downstream, upstream, valve[::-1])) == {}


# --- the law of a closed chamber: an offset of its pressure is found, a late pressure is not taken for one


PERIOD, KAPPA = 5e-3, 1.4
TIME = PERIOD * np.arange(1300)


def chamber(frequency: float, late: float = 0.0, offset: float = 0.0) -> ClosedChamber:
    """Return air that is squeezed isentropically by a sine, and read late (s) and with an offset (Pa)."""

    def volume(time: np.ndarray) -> np.ndarray:
        return 1.2e-4 * (1.0 + 0.25 * np.sin(2 * np.pi * frequency * time))

    noise = 50.0 * np.random.default_rng(1).standard_normal(TIME.size)
    p = 3e5 * (1.2e-4 / volume(TIME - late)) ** KAPPA + offset + noise
    lasts = np.full(TIME.size - 1, PERIOD)
    return ClosedChamber(-np.diff(np.log(volume(TIME))), np.diff(p), 0.5 * (p[1:] + p[:-1]), (lasts, lasts**0.5))


def test_ambient_pressure_that_is_counted_twice_is_found() -> None:
    offset, error = chamber(0.5, offset=1e5).offset(KAPPA)
    assert offset == pytest.approx(-1e5, rel=0.05)
    assert error < 0.05 * abs(offset)
    assert abs(chamber(0.5).offset(KAPPA)[0]) < 5e3


def test_a_pressure_that_is_late_in_a_fast_motion_is_no_offset() -> None:
    assert chamber(8.0, late=0.02).offset(KAPPA) == (0.0, 1.0)


# --- no guard contradicts a true recording, at any rate of logging; see also ``python -m benchmarks.guards``


WORLDS = {world: paths for world, paths in world_pipelines().items() if world != "fixtures"}
EVERY = 6  # of each world; the others in "make test-all", and in benchmarks.guards
PATHS = [
    pytest.param(path, id=f"{path.parent.name}-{path.stem}", marks=[pytest.mark.slow] if number % EVERY else [])
    for paths in WORLDS.values()
    for number, path in enumerate(paths)
]
SMALL = [path for path in FIXTURES if path.parent.name != "demo"]
fixture = cache(read)  # each at several rates


@pytest.mark.parametrize("path", FIXTURES, ids=lambda path: path.parent.name)
def test_nothing_is_found_in_the_fixtures(path: Path) -> None:
    assert fixture(path).alarms() == {}


@pytest.mark.parametrize("rate", [100.0, 3e3])
@pytest.mark.parametrize("path", SMALL, ids=lambda path: path.parent.name)
def test_nothing_is_found_in_the_fixtures_at_another_rate(path: Path, rate: float) -> None:
    assert at_rate(fixture(path), rate).alarms() == {}


@pytest.mark.real
@pytest.mark.skipif(not SHARED.is_dir(), reason="the worlds of others are not here (PNEUCLI_SHARED)")
@pytest.mark.parametrize("path", PATHS)
def test_nothing_is_contradicted_in_the_worlds_of_others(path: Path) -> None:
    """As recorded, and at 100 Hz; a doubt is allowed."""
    bench = read(path)
    for one in (bench, at_rate(bench, 100.0)):
        assert not [check for check, weight in one.alarms() if weight == "contradiction"]


# --- slopes and curvatures of blocks, lines through them, and whether a signal rests


BLOCKS_T = np.cumsum(RNG.uniform(0.8e-3, 1.2e-3, 3000))


def blocks_recorded(noise: float = 1e-6, **signals: np.ndarray) -> Recording:
    return Recording("one", "friction", "train", BLOCKS_T, signals, dict.fromkeys(signals, NoiseModel(noise)))


def test_a_parabola_has_its_slopes_and_curvature_whatever_the_clock() -> None:
    cut = Blocks.cut(blocks_recorded(x=0.1 + 0.2 * BLOCKS_T + 0.3 * BLOCKS_T**2), "x", 12)
    assert cut.curvature("x") == pytest.approx(np.full(250, 0.6))
    line = Blocks.cut(blocks_recorded(x=0.1 + 0.2 * BLOCKS_T), "x", 12)
    assert line.slope("x") == pytest.approx(np.full(250, 0.2))


def test_acceleration_is_weighed_as_the_curvature_of_the_position_weighs_it() -> None:
    """Over a third of a period, where the plain mean is 5 % off the curvature."""
    cut = Blocks.cut(blocks_recorded(x=np.sin(9 * BLOCKS_T), a=-81 * np.sin(9 * BLOCKS_T)), "x", 240)
    derived = cut.curvature("x")
    assert np.abs(cut.mean("a", 2) - derived).max() < 0.02 * np.abs(derived).max()
    assert np.abs(cut.mean("a") - derived).max() > 0.05 * np.abs(derived).max()


def test_blocks_are_as_short_as_the_noise_allows() -> None:
    x = 0.1 * np.sin(6 * BLOCKS_T)
    widths = [
        resolved_blocks(blocks_recorded(noise, x=x + noise * RNG.standard_normal(BLOCKS_T.size)), "x", 2)
        for noise in (1e-7, 1e-4)
    ]
    assert [cut and cut.width for cut in widths] == [6, 48]


def test_blocks_are_cut_once_for_all_checks() -> None:
    one = blocks_recorded(x=0.1 * np.sin(6 * BLOCKS_T))
    check = RigCheck([one], Rig(), {})
    assert check.blocks(one, "x", 2) is check.blocks(one, "x", 2)
    assert check.blocks(one, "x", 2) is not check.blocks(one, "x", 1)


def test_what_does_not_stand_clear_of_its_noise_has_no_blocks() -> None:
    assert resolved_blocks(blocks_recorded(x=1e-6 * RNG.standard_normal(BLOCKS_T.size)), "x", 2) is None
    assert resolved_blocks(blocks_recorded(x=np.full(BLOCKS_T.size, 0.1)), "x", 1) is None


def test_a_block_with_a_gap_is_left_out() -> None:
    late = Recording("one", "friction", "train", np.where(BLOCKS_T < 1.0, BLOCKS_T, BLOCKS_T + 9.0), {"x": BLOCKS_T})
    assert Blocks.cut(late, "x", 12).half_duration.max() < 0.01


def test_errors_of_a_line_hold_where_what_is_left_over_is_coloured() -> None:
    x = np.sin(0.01 * np.arange(4000))
    off = []
    for _ in range(100):
        coloured = lfilter([0.2], [1.0, -0.98], RNG.standard_normal(4000))
        line = fit_linear([x, np.ones_like(x)], 3.0 * x + coloured)
        assert line is not None
        off.append((line.factors[0] - 3.0) / line.errors[0])
    assert 0.5 < np.std(off) < 1.7


def test_too_few_values_give_no_line() -> None:
    assert fit_linear([np.ones(15)], np.ones(15)) is None


@pytest.mark.parametrize(
    ("values", "still"),
    [
        (np.full(1000, 0.1), True),
        (RNG.standard_normal(1000), True),
        (RNG.standard_normal(1000) + 1e-3 * np.arange(1000), False),
        (np.sin(0.01 * np.arange(1000)), False),
        (np.where(RNG.random(1000) < 0.5, np.nan, np.sin(np.arange(1000) / 50)), False),
        (np.full(5, 0.1), False),  # too few to tell
    ],
)
def test_constants_and_white_noise_rest(values: np.ndarray, still: bool) -> None:
    assert is_inactive(values) is still
