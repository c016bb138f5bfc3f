"""What one sample of the controller does in each situation, and laws that it keeps: the text compiled and exported."""

import importlib
import math
import re
import tomllib
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneucli.controller import cascade, codegen, observers, plant, standstill
from pneucli.controller import layout as at
from pneucli.controller import reference as shape
from tests.stored import hold_against

FILE = Path(__file__).parent / "stored" / "situations.toml"
KNOWN: dict[str, Any] = tomllib.loads(FILE.read_text(encoding="utf-8"))
ROUND: dict[str, float] = KNOWN["usual_settings"]
NODES = 5
ALONG = (1.0, 1.0, 1.0, 1.0, *6 * (0.0,))  # friction alike all over the stroke, nothing else
FILL, VENT = (1.0, 2.0, 4.0, 7.0, 10.0), (-2.0, -3.0, -5.0, -7.0, -9.0)


FILL_2, VENT_2 = (-1.0, -2.5, -4.0, -6.0, -8.0), (1.5, 2.5, 5.0, 8.0, 9.0)  # V, of a 5/3 valve's second outlet


def settings(**changed: float) -> np.ndarray:
    values = ROUND | changed
    numbers = (values[name[2:]] for name in at.PARAMETERS if name != "C_TABLE")
    second = (FILL_2, VENT_2) if values["MIRRORED"] > 0.5 else (FILL, VENT)
    return np.array([*numbers, *FILL, *VENT, *second[0], *second[1], *ALONG])


def state(**given: float) -> np.ndarray:
    s = np.zeros(len(at.STATE))
    for name, value in (KNOWN["usual_states"] | given).items():
        s[at.STATE.index(f"S_{name}")] = value
    observers.reset_prediction(s)
    for name in given.keys() & {"PREDICTED_P1", "PREDICTED_X"}:
        s[at.STATE.index(f"S_{name}")] = given[name]
    return s


def of(s: np.ndarray, *names: str) -> list[float]:
    return [float(s[at.STATE.index(f"S_{name}")]) for name in names]


C = settings()
VOLUME_1, VOLUME_2 = 2e-5 + 8e-4 * 0.1, 3e-5 + 6e-4 * 0.1


def done(function: str, one: dict[str, Any]) -> str:
    """What a function returns in a situation, and the states that are others after it."""
    module, _, name = function.partition(".")
    given = {k: v for like in one.get("like", []) for k, v in KNOWN["like"][like].items()} | one.get("given", {})
    s = np.r_[state(**{k: v for k, v in given.items() if f"S_{k}" in at.STATE}), np.zeros(at.MAX_LAW_STATES)]
    c, before = settings(**{k: v for k, v in given.items() if f"S_{k}" not in at.STATE}), s.copy()
    called, arguments = getattr(importlib.import_module(f"pneucli.controller.{module}"), name), iter(one["with"])
    returned = called(*(s if p == "s" else c if p == "c" else next(arguments) for p in signature(called).parameters))
    is_other = np.abs(s - before) > 1e-12  # less is rounding
    changed = [f"{name[2:]} {s[i] + 0.0:.9g}" for i, name in enumerate(at.STATE) if is_other[i] and "_LINE" not in name]
    return ", ".join([*([] if returned is None else [f"{float(returned):.9g}"]), *changed])


def test_what_a_function_gives_in_each_situation_is_as_stored() -> None:
    function, lines = "", []
    for stored in FILE.read_text(encoding="utf-8").splitlines():
        line = stored
        if section := re.fullmatch(r"\[\"?([^\"]+)\"?\]", stored):
            function = section[1]
        elif row := re.fullmatch(r"\"([^\"]+)\" = (.*gives = ).*", stored):
            line = f'"{row[1]}" = {row[2]}"{done(function, KNOWN[function][row[1]])}"}}'
        lines.append(line)
    hold_against(FILE, "\n".join(lines) + "\n", rel=1e-6)


# --- valve and piston


@pytest.mark.parametrize(
    ("reading", "can_be"),
    [(1.0, True), (2.0, True), (0.99, False), (2.01, False), (math.nan, False), (math.inf, False)],
)
def test_a_reading_is_usable_within_its_range(reading: float, can_be: bool) -> None:
    assert plant.is_plausible(reading, 1.0, 2.0) == can_be


def rate(filling: bool, p: float) -> float:
    """dp/dt that 1 m^2 makes (2.46), with the ratio written out; critical at 0.5."""
    up, down = (7e5, p) if filling else (p, 1e5)
    share = math.sqrt(1.0 - ((max(down / up, 0.5) - 0.5) / 0.5) ** 2)
    return 1.2e5 * 5e-3 / 1e-4 * up * 0.484 * share


@pytest.mark.parametrize("p", [1.5e5, 3e5, 5.6e5])
@pytest.mark.parametrize("filling", [True, False])
def test_an_open_valve_makes_a_gradient_by_the_flow_law(p: float, filling: bool) -> None:
    assert plant.pressure_rate_per_area(filling, p, 1e-4, state(), C) == pytest.approx(rate(filling, p))


MIRRORED = settings(MIRRORED=1.0, AREA_FILL_2=1.5e-6, AREA_VENT_2=3e-6)


def opened_share(u: float, commands: tuple[float, ...]) -> float:
    """The share of the largest area at a command: the tables hold commands at equal steps of its root."""
    order = np.argsort(commands)
    return float(np.interp(u, np.array(commands)[order], np.linspace(0.0, 1.0, NODES)[order]) ** 2)


@pytest.mark.parametrize("share", [0.002, 0.25, 0.9, 1.5, -0.002, -0.25, -0.9, -1.5])
def test_the_command_of_a_5_3_valve_inverts_the_map_of_each_chamber(share: float) -> None:
    """Both paths at that command, each by its own table, make the rate that is asked for, or all that they can."""
    filling = share > 0.0
    area_1, area_2 = (2e-6, 3e-6) if filling else (1e-6, 1.5e-6)
    tables = (FILL, VENT_2) if filling else (VENT, FILL_2)
    full_1 = area_1 * rate(filling, 4e5) * 1e-4 / (2e-5 + 8e-4 * 0.12)
    full_2 = area_2 * rate(not filling, 2.5e5) * 1e-4 / (3e-5 + 6e-4 * 0.08)
    s, wanted = state(X=0.12, P1=4e5, P2=2.5e5), share * (full_1 + 0.75 * full_2)
    reached = plant.drive_mirrored_valve(wanted, 0.12, 4e5, 2.5e5, s, MIRRORED)
    u, rate_1, rate_2 = of(s, "U1", "RATE1", "RATE2")
    way = math.copysign(1.0, share)
    assert rate_1 == pytest.approx(way * full_1 * opened_share(u, tables[0]))
    assert rate_2 == pytest.approx(-way * full_2 * opened_share(u, tables[1]))
    assert reached == pytest.approx(way * min(abs(share), 1.0) * (full_1 + 0.75 * full_2))
    assert rate_1 - 0.75 * rate_2 == pytest.approx(reached, rel=1e-6)


def test_a_5_3_valve_that_shall_do_nothing_stands_between_both_closing_edges() -> None:
    s = state(RATE1=1.0, RATE2=1.0)
    assert plant.drive_mirrored_valve(0.0, 0.1, 3e5, 3e5, s, MIRRORED) == 0.0
    assert of(s, "RATE1", "RATE2", "U1") == [0.0, 0.0, -0.5]


# --- the reference


def test_the_rate_does_not_lag_behind_a_steady_acceleration() -> None:
    """Of 2 m/s^2: the rate is that of the sample, not of a shaping time ago, nor of half a sample."""
    s, time = state(X_REF=0.1), 1e-3 * np.arange(1, 101)
    rates = [shape.reference_rate(0.1 + t**2, s, C) for t in time]
    assert rates[-1] == pytest.approx(2.0 * time[-1], rel=1e-6)
    assert of(s, "A_REF") == pytest.approx([2.0], rel=1e-6)


def test_a_jump_of_the_reference_has_no_rate() -> None:
    """Of 10 mm in a sample: 10 m/s, where 10 times the largest acceleration allows 0.05 m/s of change."""
    s = state(X_REF=0.1)
    assert shape.reference_rate(0.11, s, C) == 0.0
    assert shape.reference_rate(0.11, s, C) == 0.0
    assert of(s, "X_REF", "RAW_RATE") == [0.11, 0.0]


def shaped(reference: np.ndarray, **changed: float) -> tuple[np.ndarray, np.ndarray]:
    """Shaped position and velocity at each sample, from rest at the first reference."""
    s, c, rows = state(X_REF=reference[0], X_SHAPED=reference[0]), settings(**changed), []
    for x in reference:
        before = of(s, "X_SHAPED", "V_SHAPED")
        shape.shape_reference(float(x), s, c)
        now = of(s, "X_SHAPED", "V_SHAPED", "A_SHAPED")
        assert now[2] == pytest.approx((now[1] - before[1]) / 1e-3)
        assert now[0] == pytest.approx(before[0] + 0.5e-3 * (before[1] + now[1]))
        rows.append(now)
    return np.array(rows)[:, 0], np.array(rows)[:, 1]


@pytest.mark.parametrize("height", [0.03, -0.03])
def test_a_step_is_shaped_within_speed_and_acceleration_and_arrives_without_overshoot(height: float) -> None:
    x, v = shaped(np.where(np.arange(1500) < 10, 0.1, 0.1 + height))
    assert np.abs(np.diff(v)).max() <= 5.0 * 1e-3 * (1 + 1e-9)
    assert np.abs(v).max() <= 0.5
    assert x[-1] == pytest.approx(0.1 + height, abs=1e-7)
    way = (x - 0.1) / height
    assert way.max() <= 1.0 + 1e-3
    # time-optimal: twice the root of way over acceleration, and a few times the shaping time
    arrived = np.argmax(way > 0.99)
    assert 10 + 2e3 * np.sqrt(0.03 / 5.0) * 0.9 < arrived < 10 + 2e3 * np.sqrt(0.03 / 5.0) + 20


def test_a_long_way_is_gone_at_the_largest_speed() -> None:
    _, v = shaped(np.where(np.arange(1500) < 10, 0.02, 0.18), V_MAX=0.2)
    assert v.max() == pytest.approx(0.2)
    assert np.count_nonzero(v > 0.1999) > 500


def test_a_reference_that_keeps_to_the_limits_is_followed_exactly() -> None:
    time = 1e-3 * np.arange(3000)
    reference = 0.1 + 0.01 * np.sin(2 * np.pi * np.maximum(time - 0.1, 0.0) * 0.5)
    x, _ = shaped(reference)
    assert np.abs(x - reference)[1000:].max() < 1e-7  # a sample of it is 31 um


def test_closing_in_on_a_moving_reference_adds_to_its_speed() -> None:
    """The largest speed is that of closing in: a ramp of 0.3 m/s is caught up with at up to 0.5 m/s."""
    time = 1e-3 * np.arange(400)
    _, v = shaped(0.02 + 0.3 * time + 0.03 * (time > 0.1), V_MAX=0.2)
    assert v.max() == pytest.approx(0.5, rel=0.02)


def test_rest_is_counted_from_when_the_shaped_reference_has_arrived() -> None:
    s = state(X_REF=0.1, X_SHAPED=0.1)
    for _ in range(3):
        shape.shape_reference(0.1, s, C)
    assert of(s, "REF_REST_TIME") == pytest.approx([3e-3])
    shape.shape_reference(0.1 + 1e-7, s, C)  # it moves
    assert of(s, "REF_REST_TIME") == [0.0]


@pytest.mark.parametrize(("off", "v"), [(0.6e-5, 0.0), (0.0, 2.1e-3)])
def test_rest_needs_position_and_speed(off: float, v: float) -> None:
    """Half the reach off, or faster than the least speed, even after a sample of braking at 5 mm/s in 1 ms."""
    s = state(X_REF=0.1, X_SHAPED=0.1 + off, V_SHAPED=v, REF_REST_TIME=1.0)
    shape.shape_reference(0.1, s, settings(A_MAX=1e-3))
    assert of(s, "REF_REST_TIME") == [0.0]


# --- observers


def balanced(force: float, **given: float) -> np.ndarray:
    """A state whose pressures push with this force in N."""
    return state(**({"P1": 1e5 + (force + 6e-4 * 2e5) / 8e-4} | given))


def moved(s: np.ndarray, x: float = math.nan, **changed: float) -> np.ndarray:
    observers.observe_motion(x, s, settings(**changed))
    return s


def test_what_holds_a_piston_back_from_a_reference_that_moves_is_a_load() -> None:
    """More than its friction pushes it and it stays: friction that the model lacks holds it, until it is overcome."""
    s = balanced(100.0, V=0.0, ANCHOR=0.1, MOVING_COUNT=0.0)
    for _ in range(200):
        moved(s, 0.1)
    assert -100.0 - 20.0 < of(s, "LOAD")[0] <= -100.0 + 20.0
    s = balanced(15.0, V=0.0, ANCHOR=0.1, MOVING_COUNT=0.0)  # within the friction of the model
    for _ in range(200):
        moved(s, 0.1)
    assert of(s, "LOAD") == [0.0]


def slid(s: np.ndarray, way: float, load: float, **given: float) -> np.ndarray:
    """Let the piston slide one way for 0.2 s under this load estimate in N, beyond what seals give way."""
    known = {"V_SHAPED": 0.1 * way, "V": 0.1 * way, "EXCURSION": 1e-3 * way, "LOAD": load} | given
    for _ in range(200):
        for name, value in known.items():
            s[at.STATE.index(f"S_{name}")] = value
        observers.learn_friction(s, C)
    return s


def turned(s: np.ndarray, way: float) -> np.ndarray:
    s[at.STATE.index("S_V_SHAPED")] = way
    observers.learn_friction(s, C)
    return s


@pytest.mark.parametrize(
    ("up", "back", "known", "added", "load"),
    [
        (-4.0, 4.0, 0.0, 0.4, 0.0),  # of 10 N
        (3.0, -3.0, 0.0, -0.3, 0.0),
        (5.0, 5.0, 0.0, 0.0, 5.0),  # a load
        (-1.0, 7.0, 0.0, 0.4, 3.0),  # both
        (-40.0, 40.0, 0.0, 1.0, 30.0),  # no more than twice
        (9.0, -9.0, 0.0, -0.5, -4.0),  # no less than half
        (-3.5, 3.5, 0.4, 0.75, 0.0),  # beyond what it had learnt
    ],
)
def test_what_holds_back_on_both_ways_is_friction_that_the_model_lacks(
    up: float, back: float, known: float, added: float, load: float
) -> None:
    s = turned(slid(slid(state(ADDED_FRICTION=known), 1.0, up), -1.0, back), 1.0)
    assert of(s, "ADDED_FRICTION", "LOAD") == pytest.approx([added, load])


def test_friction_is_learnt_from_slides_alone_that_no_rest_parts() -> None:
    slow, seals, rest = {"V": 1e-3}, {"EXCURSION": 4e-4}, {"REF_REST_TIME": 0.1}
    for given in (slow, seals, rest):
        s = turned(slid(slid(state(), 1.0, -4.0, **given), -1.0, 4.0, REF_REST_TIME=0.0), 1.0)
        assert of(s, "ADDED_FRICTION", "LOAD") == [0.0, 4.0]


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_rest_of_the_reference_gives_what_was_learnt_back_to_the_load(way: float) -> None:
    s = turned(slid(slid(state(), way, -4.0 * way), -way, 4.0 * way), way)
    assert of(s, "ADDED_FRICTION", "LOAD") == pytest.approx([0.4, 0.0])
    s[at.STATE.index("S_REF_REST_TIME")] = 0.04
    assert of(turned(s, way), "ADDED_FRICTION", "LOAD") == pytest.approx([0.4, 0.0])
    s[at.STATE.index("S_REF_REST_TIME")] = 0.06
    assert of(turned(s, 0.0), "ADDED_FRICTION", "LOAD") == pytest.approx([0.0, -4.0 * way])
    assert of(turned(s, 0.0), "LOAD") == pytest.approx([-4.0 * way])


# --- the sticking piston


# a piston of 2 kg, dry friction of 10 N at any speed, no damping; pressures follow at 100 1/s, the valves let them
COASTING = settings(
    MASS=2.0,
    COULOMB=10.0,
    VISCOUS=0.0,
    VISCOUS_BACK=0.0,
    P_KP=100.0,
    STRIBECK=1e-6,
    DECELERATION_RATIO=-1.0,
    LEVEL_RATE=1e9,
    GAMMA=0.0,
)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_nothing_drives_coasts_until_friction_has_taken_its_speed(way: float) -> None:
    """From 0.1 m/s against 10 N: 2 kg x (0.1 m/s)^2 / (2 x 10 N) = 1 mm."""
    s = balanced(0.0, V=0.1 * way, BREAKAWAY_FORCE=10.0)
    assert standstill.stopping_distance(s, COASTING) == pytest.approx(1e-3 * way, rel=1e-3)


def test_the_way_until_a_command_arrives_counts() -> None:
    s = balanced(0.0, V=0.1, BREAKAWAY_FORCE=10.0)
    s[at.S_PREDICTED_X] += 2e-3
    assert standstill.stopping_distance(s, COASTING) == pytest.approx(3e-3, rel=1e-3)


def coasted(rate: float, stiff: float, lag: float) -> float:
    """Integrate 2 kg from rest, 40 N against 10 N; valves behind a ``lag`` take ``rate`` (N/s), gas ``stiff`` x way."""
    h, opened, v, x, force = 1e-6, 0.0 if lag else 1.0, 0.0, 0.0, 40.0
    while v > 0.0 or force > 10.0:
        opened += (1.0 - opened) * h / lag if lag else 0.0
        v += h * (force - 10.0) / 2.0
        x += h * v
        force = max(force - h * (opened * rate + stiff * v), 0.0)
    return x


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("gamma", "share"), [(0.0, 1.0), (1.4, 1.0), (0.0, 0.1), (1.4, 0.05)])
def test_what_drives_it_is_taken_away_no_faster_than_spool_valve_and_expanding_gas_allow(
    gamma: float, share: float, way: float
) -> None:
    """Pressures that would follow at once, by 800 N/s; gas of 1.4 (A1^2 p1 / V1 + A2^2 p2 / V2).

    A spool that goes ``share`` of its way in 1 ms has a lag of 1 ms (1 / share - 1), half a sample more than exactly.
    Steps of 5 ms find up to a tenth more.
    """
    c = settings(
        MASS=2.0, COULOMB=10.0, VISCOUS=0.0, VISCOUS_BACK=0.0, P_KP=1e4, STRIBECK=1e-6, GAMMA=gamma, SPOOL_SHARE=share,
        AREA_FILL=1e-9, AREA_VENT=1e-9,
    )  # fmt: skip
    s = balanced(40.0 * way, V=0.0, BREAKAWAY_FORCE=10.0)
    p1, p2 = of(s, "P1", "P2")
    stiff = gamma * (8e-4**2 * p1 / VOLUME_1 + 6e-4**2 * p2 / VOLUME_2)
    wanted = way * coasted(800.0, stiff, 1e-3 * (1.0 / share - 1.0))
    assert standstill.stopping_distance(s, c) == pytest.approx(wanted, rel=0.1)


@pytest.mark.parametrize("band", [10e-6, 25e-6])
def test_a_freed_piston_is_let_go_where_it_coasts_to_its_reference(band: float) -> None:
    """It coasts 1 mm; within 20 um of that its force is taken away, however wide the tolerance."""
    coasting = COASTING.copy()
    coasting[at.C_HOLDING_BAND] = band
    s = {"V": 0.1, "force": 0.0, "RELEASE_FORCE": 15.0, "MOVING_COUNT": 2.0, "BREAKAWAY_FORCE": 10.0}
    for error, kept in ((1.03e-3, 15.0), (1.01e-3, 0.0), (-1e-3, 0.0)):
        standstill.breakaway_ramp(error, found := balanced(**s), coasting)
        assert of(found, "RELEASE_FORCE") == [kept]
        assert of(found, "BRAKING_TIME") == pytest.approx([0.0 if kept else COASTING[at.C_MOTION_WINDOW]])


# --- pressures that make the force


def references(force: float, two: float = 0.0, **given: float) -> np.ndarray:
    s = state(**given)
    cascade.set_pressure_references(force, s, settings(TWO_VALVES=two))
    return s


@pytest.mark.parametrize("force", [-100.0, 0.0, 60.0])
@pytest.mark.parametrize("two", [0.0, 1.0])
def test_the_pressure_references_make_the_force(force: float, two: float) -> None:
    """One valve against chamber 2 as it is, two about the mean pressure."""
    p1, p2, kept = of(references(force, two), "P1_REF", "P2_REF", "FORCE")
    assert 8e-4 * (p1 - 1e5) - 6e-4 * (p2 - 1e5) == pytest.approx(force)
    assert kept == pytest.approx(force)
    assert p2 == pytest.approx(6e5 - p1 if two else 3e5)


# --- the whole step


def test_a_step_of_the_reference_opens_the_valve_toward_it() -> None:
    commands = {}
    for x_ref in (0.15, 0.05):
        s = np.zeros(len(at.STATE))
        for _ in range(12):
            cascade.cascade_step(x_ref, 0.1, 3e5, 3.6666667e5, s, C)
        commands[x_ref] = of(s, "U1")[0]
    assert commands[0.15] > 1.0
    assert commands[0.05] < -2.0


# --- its place in the simulation


@pytest.mark.parametrize(
    ("value", "quantum", "wanted"),
    [(0.126, 0.05, 0.15), (0.124, 0.05, 0.1), (-0.126, 0.05, -0.15), (0.126, 0.0, 0.126)],
)
def test_readings_are_rounded_to_the_nearest_quantum(value: float, quantum: float, wanted: float) -> None:
    assert codegen.quantize(value, quantum) == pytest.approx(wanted)


def test_a_missing_reading_stays_missing() -> None:
    assert math.isnan(codegen.quantize(math.nan, 0.05))


def test_a_sample_reads_logs_and_commands_late() -> None:
    cp = np.concatenate([C, [1e-4, 100.0, 1.0, 0.0]])
    cs = np.zeros(at.L_STATES + 2 * at.L_ROW)
    first, second = at.L_STATES, at.L_STATES + at.L_ROW
    cs[first + at.L_NOISE_X : first + at.L_NOISE_P2 + 1] = 0.4e-4, 160.0, -160.0
    assert codegen.control(0, 0.15, 0.1, 3e5, 3.7e5, cs, cp) == (-0.5, -0.5)  # shut
    assert cs[first + at.L_READ_X : first + at.L_READ_P2 + 1] == pytest.approx([0.1, 3.002e5, 3.698e5])
    assert codegen.control(1, 0.15, 0.1, 3e5, 3.7e5, cs, cp) == (cs[first + at.L_U1], cs[first + at.L_U2])
    logged = {
        "U1": at.L_U1, "U2": at.L_U2, "LOAD": at.L_LOAD, "P1_REF": at.L_P1_REF, "P2_REF": at.L_P2_REF,
        "FLOW1": at.L_FLOW1, "X_SHAPED": at.L_X_SHAPED, "V": at.L_V, "FORCE": at.L_FORCE,
    }  # fmt: skip
    for name, column in logged.items():
        assert cs[second + column] == of(cs, name)[0]
    assert cs[second + at.L_U1] != cs[first + at.L_U1]
