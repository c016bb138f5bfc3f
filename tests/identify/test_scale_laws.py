"""Sizes follow from the rig: what is scaled by dimension is sized and fitted alike, and found on rigs of any size."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pneucli.errors import InputError, UnitError
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.estimation.model_fit import fit_model, fit_with_effect
from pneucli.identify.estimation.parameters import base_parameters
from pneucli.identify.estimation.score_test import initial_guesses
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.residuals import residual_models
from pneucli.messages.formatting import format_figure
from pneucli.noise import NoiseModel
from pneucli.physics.declaration import BASE_PARAMETERS, Effect, Parameter
from pneucli.physics.effects import catalogue
from pneucli.physics.scales import SCALES, value_of
from pneucli.recording import Recording, Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import run, simulate
from pneucli.simulate.valve_forms import NO_VALVE, LinearValve, ValveArea
from pneucli.units import parse_unit
from tests.simulate.spring_return import CYLINDER, recordings
from tests.simulate.synthetic_experiments import FRICTION, RIG, VALVE, held_commands, make_experiment, model, time_grid

UNITS = {
    "ambient_pressure": "Pa",
    "supply_pressure": "Pa",
    "gas_constant": "J/(kg K)",
    "piston_area_1": "m^2",
    "piston_area_2": "m^2",
    "stroke": "m",
    "dead_volume_1": "m^3",
    "dead_volume_2": "m^3",
    "vessel_volume": "m^3",
    "moving_mass": "kg",
}
OF_SIGNALS = {"x": "m", "v": "m/s", "a": "m/s^2", "p1": "Pa", "p2": "Pa", "p_supply": "Pa", "u": "1"}


@dataclass(frozen=True)
class Change:
    """Of the units of length, pressure and time; temperatures and commands keep theirs."""

    length: float
    pressure: float
    time: float

    def of(self, unit: str) -> float:
        """What a quantity of that unit is multiplied by."""
        if unit == "V":
            return 1.0
        metres, kilograms, seconds, *_ = parse_unit(unit.replace("/V", "")).dimension
        mass = self.pressure * self.length * self.time**2
        return float(self.length**metres * mass**kilograms * self.time**seconds)

    def rig(self, rig: Rig) -> Rig:
        known = {f.name: getattr(rig, f.name) for f in fields(rig) if f.name in UNITS}
        return replace(rig, **{n: v * self.of(UNITS[n]) for n, v in known.items() if v is not None})

    def model(self, model: Model) -> Model:
        units = {name: parameter.unit for name, parameter in BASE_PARAMETERS.items()}
        units |= {f"{e.name}.{p.name}": p.unit for e in model.effects for p in e.parameters}
        values = {name: value * self.of(units[name]) for name, value in model.values.items()}
        valve = model.valve.scaled(self.of("m^2"))
        return replace(model, rig=self.rig(model.rig), values=values, valve=valve)

    def recording(self, recording: Recording) -> Recording:
        return replace(
            recording,
            time=recording.time * self.of("s"),
            signals={n: y * self.of(OF_SIGNALS[n]) for n, y in recording.signals.items()},
            noise={n: NoiseModel(m.white * self.of(OF_SIGNALS[n])) for n, m in recording.noise.items()},
        )


changes = st.builds(Change, *(st.floats(-1.0, 1.0).map(lambda power: 10.0**power) for _ in range(3)))


@settings(max_examples=20, deadline=None)
@given(changes)
def test_bounds_starts_and_steps_scale_by_their_dimension(change: Change) -> None:
    model = Model(RIG, (), FRICTION, VALVE)
    here, there = rig_quantities(model), rig_quantities(change.model(model))
    # a sensor and a solenoid have their own size, gravity is that of the earth, and seals give way by their own length
    scaled = [e for e in catalogue().values() if e.part != "switching valve"]
    of_effects = (p for e in scaled for p in e.parameters if not p.needs and p.name != "gravity")
    for parameter in [*BASE_PARAMETERS.values(), *of_effects]:
        mine, theirs = parameter.range_on(here), parameter.range_on(there)
        factor = change.of(parameter.unit)
        numbers = [(mine.lower, theirs.lower), (mine.upper, theirs.upper)]
        if not any("millimetre" in str(typical) for typical in parameter.typical):
            numbers += zip(mine.typical, theirs.typical, strict=True)
        assert all(b == pytest.approx(a * factor, rel=1e-9) for a, b in numbers), parameter.name


def test_an_unknown_scale_gives_neither_bounds_nor_starts() -> None:
    effect = catalogue()["constant-force"]
    unknown = rig_quantities(Model(Rig()))
    assert effect.parameters[0].range_on(unknown) == (-np.inf, np.inf, (), 0.0)
    assert initial_guesses(effect, unknown) == []


@pytest.mark.parametrize(
    ("text", "told"),
    [("0.2 suply forces", "supply forces"), ("many supply forces", "no number"), ("2 strokes", "wanted a scale")],
)
def test_an_unreadable_quantity_is_refused_at_declaration(text: str, told: str) -> None:
    with pytest.raises(UnitError, match=told):
        Parameter("force", "N", 0.0, 0.0, text, (1.0,))


def test_every_scale_is_used_and_has_a_value_on_a_complete_rig() -> None:
    declared = [*BASE_PARAMETERS.values(), *(p for e in catalogue().values() for p in e.parameters)]
    quantities = [q for p in declared for q in (p.lower, p.upper, p.step, *p.typical) if isinstance(q, str)]
    assert {q.partition(" ")[2] for q in quantities} == set(SCALES)
    facts = rig_quantities(Model(RIG, (), FRICTION, VALVE), [driven(Model(RIG, (), FRICTION, VALVE))])
    assert all(value_of(f"1 {scale.name}", scale.unit, facts) > 0.0 for scale in SCALES.values())


def noise(rig: Rig) -> dict[str, NoiseModel]:
    """What sensors add that are as good for their range as the usual ones are for the usual rig."""
    over = ((rig.supply_pressure or 0.0) - rig.ambient_pressure) / 6e5
    length = (rig.stroke or 0.2) / 0.2
    shares = {"p1": 100.0 * over, "p2": 100.0 * over, "p_supply": 100.0 * over, "x": 1e-6 * length, "a": 0.05 * length}
    return {name: NoiseModel(rms) for name, rms in shares.items()}


def recorded(model: Model, experiment: Experiment, seed: int = 1) -> Experiment:
    """The experiment as the sensors of a rig with this model would record it."""
    true, rng = simulate(model, experiment), np.random.default_rng(seed)
    own = {**experiment.recording.signals, **{n: true[n] for n in experiment.channels if n != "v"}, "a": true["a"]}
    names = [n for n in own if n in OF_SIGNALS and n != "v"]
    models = {n: m for n, m in noise(model.rig).items() if n in names}
    signals = {n: own[n] + (models[n].draw(experiment.time, rng) if n in models else 0.0) for n in names}
    taken = replace(experiment.recording, signals=signals, noise=models)
    return prepare(taken, model.rig, None)


def balanced(rig: Rig, share: float) -> dict[str, float]:
    """Pressures that hold the piston, that of chamber 1 a share of the supply's above ambient."""
    (a1, a2), above = rig.piston_areas, (rig.supply_pressure or 0.0) - rig.ambient_pressure
    return {"p1": rig.ambient_pressure + above * share, "p2": rig.ambient_pressure + above * share * a1 / a2}


def driven(model: Model) -> Experiment:
    """A piston pushed to and fro by its pressures, clear of the stops, with rests; 2 s at 1 kHz."""
    time, rig = time_grid(2.0), model.rig
    wave = np.clip(1.4 * np.sin(2 * np.pi * 3.0 * time), -1.0, 1.0) * (1.0 + 0.4 * np.sin(2 * np.pi * 0.8 * time))
    begin, force = 0.2 * (rig.stroke or 0.0), rig_quantities(model).force
    push = 0.07 * force * wave - model.sum_of_port("force", begin, 0.0, rig.stroke or 0.0)
    held = balanced(rig, 0.4)
    return recorded(
        model,
        make_experiment("friction", time, {**held, "p1": held["p1"] + push / rig.piston_areas[0], "x": begin}, rig=rig),
    )


def piloted(model: Model, effect: Effect | None = None) -> Experiment:
    """An axis whose valve is stepped through a few commands; the supply is recorded where no effect is its own."""
    time, rig = time_grid(2.4), model.rig
    u = held_commands(time, (0.0, 5.0, 0.0, -5.0, 10.0, -10.0, 2.5, -5.0, 0.0, 5.0, -2.5, 0.0), 0.2)
    signals = {"u": u, "x": 0.5 * (rig.stroke or 0.0), **balanced(rig, 0.4)}
    if effect is None or effect.part not in ("supply", "pump"):
        signals["p_supply"] = rig.supply_pressure or 0.0
    return recorded(model, make_experiment("axis", time, signals, rig=rig))


def fitted(model: Model, experiment: Experiment, effects: list[Effect]) -> Fit:
    return fit_model(replace(model, effects=()), residual_models([experiment]), effects)


@pytest.mark.parametrize("change", [Change(0.2, 0.4, 0.5), Change(6.0, 8.0, 2.0)], ids=["small", "large"])
def test_a_rig_that_is_scaled_by_dimension_is_fitted_alike(change: Change) -> None:
    effect = catalogue()["constant-force"]
    true = Model(RIG, (effect,), FRICTION | {"constant-force.force": 20.0}, VALVE)
    usual = driven(true)
    there = prepare(change.recording(usual.recording), change.rig(RIG), None)
    mine, theirs = fitted(true, usual, [effect]), fitted(change.model(true), there, [effect])
    for name, parameter in [("friction.coulomb", "N"), ("friction.viscous", "N s/m"), ("constant-force.force", "N")]:
        assert theirs[name].value == pytest.approx(mine[name].value * change.of(parameter), rel=1e-6)
    assert theirs.cost == pytest.approx(mine.cost, rel=1e-6)


SMALL = Rig(293.15, 101_300.0, 3e5, piston_area_1=2.83e-5, piston_area_2=2.1e-5, stroke=0.05,
            dead_volume_1=4e-7, dead_volume_2=4e-7, moving_mass=0.02)  # fmt: skip
LARGE = Rig(293.15, 101_300.0, 5e6, piston_area_1=3.14e-2, piston_area_2=2.8e-2, stroke=0.5, dead_volume_1=2e-3,
            dead_volume_2=2e-3, moving_mass=300.0)  # fmt: skip
# what a short drive in the middle of the stroke does not show: the ends, rests of many lengths, micrometres, a force
SPECIAL = {"end-cushion", "dwell-breakaway", "presliding", "force-skew"}


def base_of(rig: Rig) -> Model:
    """A model whose friction is the share of the supply's force that it is on the usual rig."""
    facts = rig_quantities(Model(rig))
    force = facts.force
    speed = (rig.stroke or 0.0) / 1.0
    values = {"friction.coulomb": 0.03 * force, "friction.viscous": 0.04 * force / speed}
    area = 2e-3 * (rig.piston_area_1 or 0.0) * (rig.stroke or 0.0) / 0.2
    return Model(rig, (), values, ValveArea((-10.0, -5.0, 5.0, 10.0), (area, area / 2, area / 2, area)))


@pytest.mark.parametrize("rig", [SMALL, LARGE], ids=["6 mm at 3 bar", "200 mm at 50 bar"])
@pytest.mark.parametrize("effect", [e for e in catalogue().values() if e.name not in SPECIAL], ids=lambda e: e.name)
def test_an_effect_of_typical_size_is_found_on_small_and_large_rigs(effect: Effect, rig: Rig) -> None:
    base = base_of(rig)
    if effect.part in ("linear valve", "pressure valve"):
        base = replace(base, valve=LinearValve(0.1 * max(base.valve(np.array([10.0]))), 10.0))
    mechanical = (effect.part == "cylinder" and "leak_1_2" not in effect.ports) or "read_a" in effect.ports
    facts = rig_quantities(base, [driven(base) if mechanical else piloted(base)])
    values = {
        f"{effect.name}.{p.name}": p.range_on(facts).typical[len(p.typical) // 2]
        for p in effect.parameters
        if p.value_unrefined in (None, p.null)  # a temperature sensor and a bore are laws of their own
    }
    true = replace(base, effects=(effect,), values={**base.values, **values})
    found = fitted(base, driven(true) if mechanical else piloted(true, effect), [effect])
    for name, value in values.items():
        assert not found[name].at_bound
        assert found[name].value == pytest.approx(value, abs=6.0 * found[name].error, rel=0.03)


def test_a_preloaded_spring_on_a_large_rig_stands_at_no_bound() -> None:
    """100 mm at 50 bar, pushed by a spring that would rest four strokes away, with a third of the supply's force."""
    rig = replace(LARGE, piston_area_1=7.85e-3, piston_area_2=7.0e-3, moving_mass=80.0)
    base, effect = base_of(rig), catalogue()["spring-force"]
    values = {"spring-force.stiffness": 0.08 * rig_quantities(base).force / 0.5, "spring-force.rest_position": 2.0}
    true = replace(base, effects=(effect,), values={**base.values, **values})
    found = fitted(base, driven(true), [effect])
    assert not any(e.at_bound for e in found.estimates)
    for name, value in values.items():
        assert found[name].value == pytest.approx(value, rel=0.03)


def test_an_effect_without_a_scale_is_refused_by_name() -> None:
    base = base_of(SMALL)
    lost = replace(catalogue()["constant-force"], name="lost", parameters=(
        Parameter("force", "N", 0.0, 0.0, 1e3, ("1 supply forces",)),
        Parameter("length", "m^2", None, 0.0, 1.0, ("0.1 valve areas",)),
    ), ports={"force": lambda x, v, stroke, force, length: -force})  # fmt: skip
    found = fit_model(replace(base, valve=NO_VALVE), residual_models([driven(base)]), [])
    with pytest.raises(InputError, match="valve areas: the effective area at the largest command"):
        fit_with_effect(found, residual_models([driven(base)]), lost)


def test_base_parameters_are_bounded_by_the_rig() -> None:
    for rig in (SMALL, LARGE):
        model = base_of(rig)
        facts = rig_quantities(model)
        free = {f.name: f for f in base_parameters(model, [driven(model)])}
        assert free["friction.coulomb"].upper == pytest.approx(2.0 * facts.force)
        assert free["friction.viscous"].upper > 100.0 * model.values["friction.viscous"]


def test_a_motionless_reading_is_made_ready_without_a_fault() -> None:
    """It has neither noise nor spread; whether that is refused, who asks for a fit decides."""
    flat = np.ones(400)
    signals = {"x": 0.1 * flat, "a": 0.0 * flat, "p1": 3e5 * flat, "p2": 3e5 * flat}
    ready = prepare(Recording("still", "friction", "train", time_grid(0.399), signals), RIG, None)
    assert np.isfinite(ready.inputs).all()
    assert ready.inputs[:, 6] == pytest.approx(0.1)


# --- bounds are as wide as what people have, and as the limits that textbooks use


RT, KAPPA, AMBIENT, SUPPLY = 287.0 * 293.15, 1.4, 101_325.0, 7e5


@pytest.mark.parametrize(
    ("name", "share"), [("line-delay", 1.0), ("valve-lag", 1.0), ("time-skew", 0.5), ("pressure-lag", 0.5)]
)
def test_delays_and_lags_go_as_far_as_the_model_predicts(name: str, share: float) -> None:
    """Half of it where the reading at the restart is late: the other half predicts what it does not show."""
    time = time_grid(4.0)
    restarted = make_experiment("axis", time, {"u": np.sin(time), "p1": 3e5}, restarts=tuple(range(0, time.size, 800)))
    parameter = catalogue()[name].parameters[0]
    assert parameter.range_on(rig_quantities(model(), [restarted])).upper == pytest.approx(share * 0.8)
    alone = rig_quantities(model())
    assert parameter.range_on(alone).upper == pytest.approx(share * alone.response_time)


@pytest.mark.parametrize(("volume", "supply", "scale"), [(2e-4, 7e5, 1.0), (2e-2, 5e6, 20.0)])
def test_gas_at_the_bound_of_heat_transfer_is_isothermal(volume: float, supply: float, scale: float) -> None:
    """A vessel of 0.2 l at 7 bar, and one of 20 l at 50 bar, filled and vented at full opening."""
    rig = Rig(supply_pressure=supply, vessel_volume=volume)
    heat = catalogue()["heat-transfer"]
    wide = ValveArea(VALVE.commands, tuple(scale * a for a in VALVE.areas))
    plain = Model(rig, (), {"rig.vessel_volume": volume}, wide)
    facts = rig_quantities(plain)
    time = time_grid(4.0 * facts.fill_time, facts.fill_time / 500.0)
    u = np.where(time < 2.0 * facts.fill_time, 10.0, -10.0)
    filled = make_experiment("valve", time, {"u": u, "p1": AMBIENT, "p_supply": supply}, rig=rig)
    isothermal = run(replace(plain, values={**plain.values, "rig.polytropic_exponent": 1.0}), filled)[:, at.P1]

    def error(conductance: float) -> float:
        values = {**plain.values, "heat-transfer.conductance": conductance}
        return float(np.abs(run(replace(plain, effects=(heat,), values=values), filled)[:, at.P1] - isothermal).max())

    bound = heat.parameters[0].range_on(facts).upper
    assert error(bound) < 1e-3 * supply
    assert error(bound / 50.0) > 1e-2 * supply


def tank(delay: float) -> tuple[Recording, Rig]:
    """A tank of 1 l that fills in 0.12 s, adiabatic, behind a linear valve whose command comes late, read at 100 Hz."""
    rng, step, every = np.random.default_rng(4), 1e-4, 100
    time = step * np.arange(90_000)
    u = rng.choice([3.0, 5.0, 8.0, 10.0, -2.0, -4.0, -7.0, -10.0], 20).repeat(4_500)
    late = np.concatenate([np.zeros(round(delay / step)), u])[: u.size]
    p, course = AMBIENT, np.empty(u.size)
    for k, command in enumerate(late.tolist()):
        course[k] = p
        upper, lower = (SUPPLY, p) if command > 0.0 else (p, AMBIENT)
        ratio = min(lower / upper, 1.0)
        psi = 0.484 if ratio < 0.528 else 0.484 * np.sqrt(1.0 - ((ratio - 0.528) / 0.472) ** 2)
        p += step * KAPPA * RT / 1e-3 * 3e-6 * command * upper * np.sqrt(2.0 / RT) * psi
    chosen = slice(None, None, every)
    read = {"u": u[chosen], "p1": course[chosen] + 400.0 * rng.standard_normal(900), "p_supply": np.full(900, SUPPLY)}
    noise = {"p1": NoiseModel(400.0), "p_supply": NoiseModel(0.0), "u": NoiseModel(0.0)}
    return Recording("tank", "valve", "train", time[chosen], read, noise), Rig(vessel_volume=1e-3)


def test_a_dead_time_of_half_a_response_time_is_found() -> None:
    one, rig = tank(0.06)
    ready = [prepare(one, rig, 0.5)]
    views = residual_models(ready, whiten_initial_state=True)
    found = fit_model(guess_base_model(ready, rig), views, [catalogue()["time-skew"]])["time-skew.delay"]
    assert found.value == pytest.approx(0.06, abs=4e-3)
    assert (found.figure.low, found.figure.high) == found.ci95


def friction_by_pressure(coulomb: float) -> tuple[Estimate, Estimate]:
    """Dry friction and its growth with pressure, fitted where 2 N come for each bar."""
    held = replace(CYLINDER, coulomb=coulomb, seal=2e-5, stroke=0.3, preload=-90.0, start=0.1)
    ready = [prepare(one, held.rig(), 0.5) for one in recordings(held)[:2]]
    effects = [catalogue()[name] for name in ("spring-force", "pressure-friction")]
    found = fit_model(guess_base_model(ready, held.rig()), residual_models(ready), effects)
    return found["friction.coulomb"], found["pressure-friction.gain"]


def test_friction_may_be_by_pressure_for_the_most() -> None:
    dry, gain = friction_by_pressure(1.8)
    assert dry.value == pytest.approx(1.8, abs=0.1)
    assert dry.value * gain.value == pytest.approx(2.0, rel=0.05)
    assert not gain.at_bound


def test_friction_by_pressure_alone_grows_by_at_least_the_bound() -> None:
    """Any larger ratio describes these recordings as well or better."""
    _, gain = friction_by_pressure(0.0)
    assert format_figure(gain.figure).startswith("at least")
