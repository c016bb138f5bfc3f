"""The identification of friction as a whole: results, warnings, other effects, and the parameters that were set."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pneucli.errors import InputError
from pneucli.exam.rig.parameters import Parameters
from pneucli.figure import Figure
from pneucli.identify.friction import identification
from pneucli.identify.friction.identification import (
    FrictionIdentification,
    identify_friction,
    level_warnings,
    model_a_warnings,
    unmodelled_effects,
)
from pneucli.identify.friction.kinematics import NonFrictionForces, estimate_motion
from pneucli.identify.friction.regression import UNITS, FrictionFit, fit_coulomb, fit_stribeck, velocity_friction
from pneucli.identify.friction.samples import MovingSamples
from pneucli.messages.findings import Finding
from pneucli.physics.effects import catalogue
from pneucli.physics.vectorised import stribeck_friction
from pneucli.quantities import Z95
from pneucli.recording import Recording
from pneucli.simulate.model import Model
from tests.identify_friction.synthetic_recordings import (
    BENCH,
    FIXTURES,
    RIG,
    case,
    fixture_truth,
    identified,
    load,
    pressed,
    pulses,
    recorded,
)

STICKY = BENCH._replace(static=18.0, stribeck_velocity=0.015)


@cache
def run() -> Recording:
    return recorded(STICKY, pressed(STICKY, pulses(2, 30.0)), 1)


def test_everything_for_tables_and_figures_is_there() -> None:
    found = identified(FIXTURES / "friction_null_stribeck")
    assert [m.name for m in found.models] == list("ABCDEF")
    assert [c.branch for c in found.curves] == ["accelerating", "slowing", "both"]
    assert found.stick_slips
    assert found.averages
    assert [k.recording for k in found.kinetic] == ["driven_1", "driven_2"]  # those that stroke both ways
    assert found.model("D").title.startswith("Stribeck")


def test_measured_curves_contain_the_true_friction_within_their_intervals() -> None:
    found = identified(FIXTURES / "friction_null_stribeck")
    model = found.model("A")
    for curve in found.curves:
        clear = np.abs(curve.v) > 0.02  # where the law is steep, the mean over a bin is not the law at its middle
        inside = (curve.ci_low <= model.force(curve.v)) & (model.force(curve.v) <= curve.ci_high)
        assert np.mean(inside[clear]) > 0.85


def test_test_recordings_are_not_fitted_to() -> None:
    recordings, rig = load(FIXTURES / "friction_null_coulomb")
    spoilt = [r if r.use == "train" else _spoilt(r) for r in recordings]
    assert identify_friction(spoilt, Model(rig)).parameters == identified(FIXTURES / "friction_null_coulomb").parameters


def _spoilt(recording):  # type: ignore[no-untyped-def]
    return replace(recording, signals={**recording.signals, "p1": recording["p1"] + 5e4})


def test_axis_recordings_serve_where_there_is_no_friction_test() -> None:
    found = identify_friction([replace(run(), experiment="axis")], Model(RIG))
    assert found.parameters["coulomb"].value == pytest.approx(12.0, rel=0.03)


def test_a_constant_force_is_identifiable_only_from_both_directions() -> None:
    rising = pressed(STICKY, np.abs(pulses(2, 30.0)) * 0.8)
    one_way = identify_friction([recorded(STICKY, rising, 2)], Model(RIG))
    assert "offset" not in one_way.parameters
    assert "one-direction" in {warning.code for warning in one_way.warnings}


def test_the_grid_is_the_users_to_choose() -> None:
    found = identify_friction([run()], Model(RIG), nodes=400, max_velocity=0.05, sign_steepness=2000.0)
    grid = found.model("E").branches[0].tp.grids[0]
    assert grid.size == 400
    assert grid[[0, -1]] == pytest.approx([-0.05, 0.05])
    assert found.domain.eta == 2000.0
    assert found.model("A").force(np.array([1.0])) == pytest.approx(found.model("A").force(np.array([0.05])))


def test_what_cannot_be_identified_is_said() -> None:
    with pytest.raises(InputError, match="no friction test to train on"):
        identify_friction([replace(run(), use="test")], Model(RIG))
    resting = recorded(BENCH, pressed(BENCH, np.zeros(500)), 3)
    with pytest.raises(InputError, match="moving samples"):
        identify_friction([resting], Model(RIG))
    with pytest.raises(InputError, match="friction model"):
        identify_friction([run()], Model(RIG)).model("G")


def test_a_piston_that_stands_on_an_end_throughout_shows_no_friction() -> None:
    model = Model(replace(RIG, stroke=1.0))
    moving = run()
    noise = 1e-6 * np.random.default_rng(5).standard_normal(moving.time.size)
    signals = {name: y for name, y in moving.signals.items() if name not in ("v", "a")}
    standing = replace(moving, name="standing", signals={**signals, "x": 1.0 + noise})
    found = identify_friction([moving, standing], model)
    assert [m.recording.name for m in found.motions] == [moving.name]
    with pytest.raises(InputError, match="0 moving samples"):
        identify_friction([standing], model)


def test_a_mass_left_out_is_identified() -> None:
    found = identify_friction([run()], Model(replace(RIG, moving_mass=None)))
    assert found.mass is not None
    assert found.mass.value == pytest.approx(2.0, rel=0.03)


# --- warnings about identified friction, and the parameters that they rest on


NAMES = ("coulomb", "viscous", "static", "velocity", "offset")
USUAL = {"coulomb": 12.0, "viscous": 40.0, "static": 20.0, "velocity": 0.02, "offset": 0.0}
SPEED, FORCE = np.array([0.1, -0.1]), np.array([16.0, -16.0])
FAST = MovingSamples(SPEED, 0.0 * SPEED, FORCE, FORCE, np.ones(2), np.ones(2, np.int8), np.arange(2))
NONE: dict[Any, tuple[str, ...]] = {"A": ()}


def fitted(deviation: float = 1.0, error: float = 1.0, **values: float) -> FrictionFit:
    """A friction model whose parameters have 95 % intervals of +- ``error``."""
    names = tuple(n for n in NAMES if n not in values or not np.isnan(values[n]))
    theta = np.array([(USUAL | values)[n] for n in names])
    return FrictionFit(names, theta, (error / Z95) ** 2 * np.eye(len(names)), deviation)


def warned(fit: FrictionFit, unmodelled: Any = None) -> list[Finding]:
    return list(model_a_warnings(fit, FAST, unmodelled or NONE))


def kinds(fit: FrictionFit) -> list[str]:
    return [warning.code for warning in warned(fit)]


def test_a_model_that_describes_its_samples_has_no_warning() -> None:
    assert warned(fitted()) == []
    assert warned(fitted(static=np.nan, velocity=np.nan, offset=np.nan)) == []


@pytest.mark.parametrize(
    ("offset", "expected"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True), (30.0, True)]
)
def test_a_constant_force_is_significant_where_its_interval_excludes_zero(offset: float, expected: bool) -> None:
    assert warned(fitted(offset=offset)) == [Finding("force-offset", {"force": offset})] * expected


@pytest.mark.parametrize(("coulomb", "expected"), [(1.01, False), (0.99, True)])
def test_dry_friction_is_significant_where_its_interval_lies_above_zero(coulomb: float, expected: bool) -> None:
    assert kinds(fitted(coulomb=coulomb)) == ["dry-friction-not-significant"] * expected


@pytest.mark.parametrize(("velocity", "expected"), [(0.0249, False), (0.0251, True)])
def test_static_friction_is_uncertain_with_a_stribeck_velocity_beyond_a_quarter_of_the_highest_speed(
    velocity: float, expected: bool
) -> None:
    assert kinds(fitted(velocity=velocity)) == ["static-friction-uncertain"] * expected


@pytest.mark.parametrize(
    ("unmodelled", "better"),
    [
        ({"A": (), "D": ()}, []),
        ({"A": ("hysteresis",), "D": ("hysteresis",)}, []),
        ({"A": ("hysteresis",), "D": (), "E": ()}, ["D", "E"]),
        ({"A": ("hysteresis", "position"), "D": ("position",), "E": ("other",)}, ["D"]),
    ],
)
def test_a_misfit_names_the_effects_that_a_cannot_represent_and_the_models_that_can(
    unmodelled: Any, better: list[str]
) -> None:
    limit = identification.MAX_RESIDUAL_TO_NOISE
    (misfit,) = warned(fitted(limit + 0.06), unmodelled)
    assert (misfit.code, misfit.values["ratio"]) == ("misfit", limit + 0.06)
    assert (misfit.values["unmodelled"], misfit.values["better"]) == (unmodelled["A"], better)
    assert warned(fitted(limit), unmodelled) == []


def level(low: float, value: float, high: float) -> Any:
    return SimpleNamespace(friction=Figure(value, low, high, "N"))


def test_levels_of_recordings_differ_where_their_intervals_are_apart() -> None:
    assert list(level_warnings([])) == []
    assert list(level_warnings([level(10.0, 11.0, 12.0), level(12.0, 13.0, 14.0)])) == []
    assert list(level_warnings([level(10.0, 11.0, 12.0), level(12.1, 13.0, 14.0)])) == [
        Finding("levels-differ", {"lowest": 11.0, "highest": 13.0})
    ]


def test_every_parameter_has_its_unit_and_forces_and_masses_an_interval_from_zero_on() -> None:
    found = fitted(error=30.0).values()
    assert {n: v.unit for n, v in found.items()} == {
        "coulomb": "N", "viscous": "N s/m", "static": "N", "velocity": "m/s", "offset": "N",
    }  # fmt: skip
    assert UNITS["mass"] == "kg"
    assert (found["coulomb"].low, found["coulomb"].high) == (0.0, pytest.approx(42.0))
    assert (found["viscous"].low, found["viscous"].high) == (pytest.approx(10.0), pytest.approx(70.0))
    assert (found["offset"].low, found["offset"].high) == (pytest.approx(-30.0), pytest.approx(30.0))


def recording(kind: str, use: str = "train") -> Recording:
    return Recording(f"{kind} {use}", kind, use, np.arange(3.0), {})  # type: ignore[arg-type]


def test_friction_tests_come_before_axis_recordings_and_valve_tests_never() -> None:
    def used(*rows: Recording) -> list[str]:
        return [r.name for r in identification._friction_recordings(rows)]

    test, axis, valve = recording("friction"), recording("axis"), recording("valve")
    assert used(valve, axis, test, recording("friction", "test")) == ["friction train", "friction test"]
    assert used(valve, axis) == ["axis train"]
    for rows in ((valve,), (axis, recording("friction", "test")), ()):
        with pytest.raises(InputError) as error:
            used(*rows)
        told = error.value
        assert (told.where, told.found, told.wanted) == (
            "recordings", "no friction test to train on", 'experiment = "friction", use = "train"',
        )  # fmt: skip


# --- fitted friction parameters: against what was set on the fixtures and cases, and whether the intervals hold


BLOCK = 0.2  # s
WITHIN = 0.03  # the issue's: friction parameters within 3 % on null fixtures


@pytest.mark.parametrize("name", ["friction_null_coulomb", "friction_null_stribeck"])
def test_parameters_of_the_null_fixtures_are_within_3_percent(name: str) -> None:
    truth, found = fixture_truth(name), identified(FIXTURES / name).parameters
    assert found["coulomb"].value == pytest.approx(truth["coulomb"], rel=WITHIN)
    assert found["viscous"].value == pytest.approx(truth["viscous"], rel=WITHIN)
    assert found["offset"].value == pytest.approx(0.0, abs=WITHIN * truth["coulomb"])
    if name == "friction_null_stribeck":
        assert found["static"].value == pytest.approx(truth["static"], rel=WITHIN)
        assert found["velocity"].value == pytest.approx(truth["stribeck_velocity"], rel=WITHIN)
    else:
        assert "velocity" not in found  # no Stribeck fall is claimed where none is


def test_both_branches_of_the_hysteretic_fixture_are_within_3_percent() -> None:
    truth, found = fixture_truth("friction_hysteresis"), identified(FIXTURES / "friction_hysteresis")
    rising, falling = (branch.parameters for branch in found.model("D").branches)
    assert rising["coulomb"].value == pytest.approx(truth["coulomb"], rel=WITHIN)
    assert rising["viscous"].value == pytest.approx(truth["viscous"], rel=WITHIN)
    assert falling["coulomb"].value == pytest.approx(truth["coulomb"] * (1 - truth["drop"]), rel=WITHIN)
    assert falling["viscous"].value == pytest.approx(truth["viscous"], rel=WITHIN)


@pytest.mark.parametrize("number", ["13", "16"])
def test_parameters_of_another_virtual_rig_are_within_3_percent(number: str) -> None:
    """Cases whose friction is Coulomb, viscous, Stribeck, with or without a constant force; truth.json has them."""
    truth = json.loads((case(number) / "truth.json").read_text(encoding="utf-8"))
    found = identified(case(number)).parameters
    hidden = truth["hidden"]
    assert found["coulomb"].value == pytest.approx(truth["base"]["coulomb"], rel=WITHIN)
    assert found["viscous"].value == pytest.approx(truth["base"]["viscous"], rel=WITHIN)
    constant = hidden.get("constant-force", {"force": 0.0})["force"]
    assert found["offset"].value == pytest.approx(constant, abs=WITHIN * truth["base"]["coulomb"])
    assert ("velocity" in found) == ("stribeck" in hidden)
    if "stribeck" in hidden:
        assert found["static"].value == pytest.approx(hidden["stribeck"]["static"], rel=WITHIN)
        assert found["velocity"].value == pytest.approx(hidden["stribeck"]["velocity"], rel=WITHIN)


def test_friction_that_drifts_is_a_misfit_of_a_function_of_velocity() -> None:
    assert "misfit" in {warning.code for warning in identified(case("17")).warnings}


def synthetic(seed: int, pole: float, static: float = 10.0) -> MovingSamples:
    """20 s of wandering velocity, and friction with correlated errors of 0.5 N."""
    rng = np.random.default_rng(seed)
    n = 4000
    v = 0.15 * np.sin(np.arange(n) * 0.005 * 2 * np.pi / rng.uniform(1, 2)) + 1e-4
    noise = lfilter([0.5 * np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(n + 500))[500:]
    friction = stribeck_friction(v, 10.0, 50.0, static, 0.02) + noise
    zero = np.zeros(n)
    block = (np.arange(n) * 0.005 / BLOCK).astype(np.int64)
    return MovingSamples(v, zero, friction, friction, zero + 0.5, zero.astype(np.int8), block)


@pytest.mark.parametrize("pole", [0.0, 0.9], ids=["white", "correlated over 10 samples"])
def test_intervals_cover_the_truth_though_residuals_are_correlated(pole: float) -> None:
    hits = []
    for seed in range(60):
        found = fit_coulomb(synthetic(seed, pole), offset=True).values()
        truth = {"coulomb": 10.0, "viscous": 50.0, "offset": 0.0}
        hits += [found[k].low <= t <= found[k].high for k, t in truth.items()]
    # 95 % of 180: below 88 % in less than one run of ten thousand, were they independent
    assert np.mean(hits) >= 0.88


def test_stribeck_friction_is_found_where_it_is_and_only_there() -> None:
    claimed = ["velocity" in fit_stribeck(synthetic(seed, 0.9), offset=True).names for seed in range(15)]
    found = ["velocity" in fit_stribeck(synthetic(seed, 0.9, static=15.0), offset=True).names for seed in range(15)]
    assert sum(claimed) <= 1
    assert all(found)


def test_single_wild_samples_do_not_move_the_fit() -> None:
    clean = synthetic(3, 0.0)
    friction = clean.friction.copy()
    friction[::50] += 30.0
    wild = MovingSamples(**{**clean.__dict__, "friction": friction})
    assert fit_coulomb(wild, offset=True)["coulomb"] == pytest.approx(10.0, rel=WITHIN)
    assert fit_coulomb(wild, offset=True)["offset"] == pytest.approx(0.0, abs=0.1)


def test_the_fitted_friction_is_that_of_the_physics() -> None:
    v = np.linspace(-0.3, 0.3, 101)
    values = {"coulomb": 8.0, "viscous": 30.0, "static": 13.0, "velocity": 0.02}
    assert velocity_friction(v, values) == pytest.approx(stribeck_friction(v, 8.0, 30.0, 13.0, 0.02))
    assert velocity_friction(v, {**values, "velocity": 0.0}) == pytest.approx(8.0 * np.sign(v) + 30.0 * v)


# --- A to F are fitted and replayed beside the pipeline's other effects, and it is said which on friction they lack


LOADED = BENCH._replace(constant_force=4.0, spring_stiffness=150.0, spring_rest=0.1)
LOADS = {"constant-force.force": 4.0, "spring-force.stiffness": 150.0, "spring-force.rest_position": 0.1}


def model(values: dict[str, float]) -> Model:
    """The bench's rig and the effects whose parameters are given."""
    known = catalogue()
    return Model(RIG, tuple(known[name] for name in dict.fromkeys(n.partition(".")[0] for n in values)), values)


def runs(par: Parameters) -> list[Recording]:
    return [recorded(par, pressed(par, pulses(2, peak)), seed) for seed, peak in enumerate((28.0, 34.0))]


@cache
def found_with() -> FrictionIdentification:
    return identify_friction(runs(LOADED), model(LOADS))


@cache
def found_without() -> FrictionIdentification:
    return identify_friction(runs(LOADED), model({}))


def times_noise(found: FrictionIdentification, name: str, channel: str) -> float:
    (pooled,) = [d for d in found.deviations if (d.model, d.recording, d.channel) == (name, "all", channel)]
    return pooled.rmsd / pooled.noise


def test_the_parameters_of_a_lie_in_their_intervals_with_a_spring_and_a_constant_force() -> None:
    assert found_with().removed_effects == ("constant-force", "spring-force")
    for name, truth in (("coulomb", LOADED.coulomb), ("viscous", LOADED.viscous), ("offset", 0.0)):
        assert found_with().parameters[name].low <= truth <= found_with().parameters[name].high, name


@pytest.mark.parametrize("name", "AB")
def test_its_replay_is_at_the_noise_with_the_other_effects(name: str) -> None:
    assert times_noise(found_with(), name, "a") < 1.3
    assert times_noise(found_with(), name, "v") < 2.0
    assert times_noise(found_without(), name, "v") > 3.0 * times_noise(found_with(), name, "v")


def test_without_them_a_constant_force_and_a_misfit_are_reported() -> None:
    assert found_with().warnings == ()
    warnings = {warning.code: warning.values for warning in found_without().warnings}
    assert "force-offset" in warnings
    assert warnings["misfit"]["unmodelled"] == ()


@pytest.mark.parametrize(
    ("values", "distortion"),
    [
        ({"pressure-offset.offset": 2e4}, lambda p, time: p + 2e4),
        ({"pressure-scale.scale": 1.05}, lambda p, time: RIG.ambient_pressure + 1.05 * (p - RIG.ambient_pressure)),
        ({"time-skew.delay": 0.006}, lambda p, time: np.interp(time - 0.006, time, p)),
    ],
    ids=["offset of p1", "scale", "skew"],
)
def test_faults_of_pressure_sensors_are_removed(values: dict[str, float], distortion) -> None:  # type: ignore[no-untyped-def]
    time = 1e-3 * np.arange(2000)
    p1, p2 = 3e5 + 5e4 * np.sin(2 * np.pi * time), 3e5 + 3e4 * np.cos(2 * np.pi * time)
    read = {"p1": distortion(p1, time), "p2": distortion(p2, time)}
    if "pressure-offset.offset" in values:
        read["p2"] = p2
    true = NonFrictionForces(model(values)).corrected_readings(time, read)
    inner = slice(20, -20)
    assert true["p1"][inner] == pytest.approx(p1[inner], rel=2e-4)
    assert true["p2"][inner] == pytest.approx(p2[inner], rel=2e-4)


def test_a_force_is_put_back_to_when_it_acted() -> None:
    time = 1e-3 * np.arange(2000)
    read = {"force": np.sin(2 * np.pi * (time - 0.006)), "p1": np.full(2000, 3e5)}
    true = NonFrictionForces(model({"force-skew.delay": 0.006})).corrected_readings(time, read)
    assert true["force"][:-10] == pytest.approx(np.sin(2 * np.pi * time)[:-10], abs=1e-4)
    assert np.array_equal(true["p1"], read["p1"])
    without = {"p1": read["p1"]}
    assert set(NonFrictionForces(model({"force-skew.delay": 0.006})).corrected_readings(time, without)) == {"p1"}


def test_a_mass_of_the_model_moves_with_the_rigs() -> None:
    heavy = BENCH._replace(extra_mass=0.5)
    found = identify_friction(runs(heavy), model({"extra-mass.mass": 0.5}))
    assert found.mass is not None
    assert found.mass.value == pytest.approx(2.5)
    assert times_noise(found, "A", "a") < 1.3


def test_a_force_that_depends_on_position_asks_for_it() -> None:
    blind = recorded(LOADED, pressed(LOADED, pulses(2, 28.0)), 1, ("p1", "p2", "a"))
    assert np.isfinite(estimate_motion(blind, model({"constant-force.force": 4.0})).drive).all()
    with pytest.raises(Exception, match="x was not recorded, and a force depends on it"):
        estimate_motion(blind, model(LOADS))


def shown(values: dict[str, float]) -> dict[str, tuple[str, ...]]:
    described = model(values)
    return dict(unmodelled_effects(described, [estimate_motion(runs(LOADED)[0], described)]))


STRIBECK = {"stribeck.static": 18.0, "stribeck.velocity": 0.015}
HYSTERESIS = {"friction-hysteresis.drop": 0.4}


@pytest.mark.parametrize(
    ("values", "without"),
    [
        (LOADS, ""),
        (STRIBECK, "DE"),  # they have its rise while speeding up only
        (STRIBECK | HYSTERESIS, "ABC"),
        ({"friction-asymmetry.asymmetry": 0.2, "friction-asymmetry.viscous_asymmetry": 0.1}, "ABDE"),
        ({"pressure-friction.gain": 0.1}, "ABCDEF"),
        ({"position-friction.from": 0.0, "position-friction.to": 0.1, "position-friction.gain": 0.3}, "ABCDEF"),
        ({"presliding.stiffness": 1e6, "presliding.damping": 100.0}, "ABCDEF"),
        ({"dwell-breakaway.gain": 0.3, "dwell-breakaway.time_constant": 1.0}, "ABCDEF"),
    ],
    ids=["loads", "stribeck", "hysteresis", "asymmetry", "pressure", "position", "presliding", "dwell"],
)
def test_effects_that_each_model_cannot_represent(values: dict[str, float], without: str) -> None:
    assert {name for name, effects in shown(values).items() if effects} == set(without)


def test_a_misfit_of_a_is_attributed_to_effects_that_it_cannot_represent() -> None:
    friction = BENCH._replace(viscous_asymmetry=0.5)
    values = {"friction-asymmetry.asymmetry": 0.0, "friction-asymmetry.viscous_asymmetry": 0.5}
    found = identify_friction(runs(friction), model(values))
    (misfit,) = [warning.values for warning in found.warnings if warning.code == "misfit"]
    assert misfit["unmodelled"] == ("friction-asymmetry",)
    assert misfit["better"] == ["C", "F"]


def test_a_weight_that_moved_along_in_one_recording_is_not_friction_nor_the_rigs_mass() -> None:
    light, heavy = runs(BENCH)[0], runs(BENCH._replace(extra_mass=2.0))[1]
    unknown = Model(replace(RIG, moving_mass=None))
    found = identify_friction([light, replace(heavy, added_mass=2.0)], unknown)
    assert found.mass is not None
    assert found.mass.low <= BENCH.mass <= found.mass.high
    for name, truth in (("coulomb", BENCH.coulomb), ("viscous", BENCH.viscous)):
        assert found.parameters[name].low <= truth <= found.parameters[name].high, name
    assert times_noise(found, "A", "a") < 1.3
    assert times_noise(identify_friction([light, heavy], unknown), "A", "a") > 3.0
