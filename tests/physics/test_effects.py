"""Properties of every effect of the catalogue, from its declaration: nothing here names the effects one by one,
but where physics makes one an exception.
"""

import inspect
import itertools
import math
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lti

from pneucli.design.effect_compensation import opening_after
from pneucli.errors import InputError
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.kernel import valve_area
from pneucli.exam.rig.parameters import Parameters
from pneucli.physics.declaration import BASE_PARAMETERS, Effect, Parameter
from pneucli.physics.effects import all_effects, catalogue, load_plugin, select_effects
from pneucli.physics.ports import PORTS
from pneucli.physics.scales import RigQuantities
from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.run import base_vector, run
from pneucli.units import parse_quantity
from tests.simulate.synthetic_experiments import (
    FRICTION,
    RIG,
    STRIBECK,
    held_commands,
    make_experiment,
    model,
    time_grid,
    typical_values,
)

EFFECTS = list(catalogue().values())
VESSEL_VOLUME = {"rig.vessel_volume": 1.6e-4}
FACTS = rig_quantities(model())
TIME = time_grid(0.6)
U = held_commands(TIME, (0.0, 3.0, -3.0, 0.5, 0.0, 0.0), 0.1)
FILL = 3e5 + 1.5e5 * np.sin(2 * np.pi * 2.0 * TIME)


def runs(effect: Effect) -> Iterator[Experiment]:
    """Short manoeuvres of every kind in which the effect acts; they move both ways, rest, and break away."""
    pneumatic = {"u": U}
    candidates = [
        make_experiment("valve", TIME, {**pneumatic, "p1": 2e5}),
        make_experiment("friction", TIME, {"p1": FILL, "p2": 3e5}),
        make_experiment("friction", TIME, {"p1": 3e5, "p2": 3e5, "force": 40.0 * np.sin(50.0 * TIME)}),
        make_experiment("axis", TIME, pneumatic),
        make_experiment("axis", TIME, {**pneumatic, "u2": -U}, "valve", restarts=(0, 333)),
    ]
    return (e for e in candidates if e.active_effects((effect,)))


def simulated(effect: Effect, values: dict[str, float], experiment: Experiment) -> np.ndarray:
    return run(model([effect.name], VESSEL_VOLUME | values), experiment)


def absent(effect: Effect, experiment: Experiment) -> np.ndarray:
    """The same rig without the effect."""
    return run(replace(model([effect.name], VESSEL_VOLUME), effects=()), experiment)


def nulls(effect: Effect) -> dict[str, float]:
    """The parameters at which the effect vanishes; a parameter without such a value is typical."""
    own = typical_values([effect])
    for p in effect.parameters:
        if p.null is not None:
            own[f"{effect.name}.{p.name}"] = FRICTION[p.null] if isinstance(p.null, str) else p.null
    return own


def corners(effect: Effect) -> Iterator[dict[str, float]]:
    names = [f"{effect.name}.{p.name}" for p in effect.parameters]
    for values in itertools.product(*(p.range_on(FACTS)[:2] for p in effect.parameters)):
        yield dict(zip(names, values, strict=True))


every_effect = pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)


@every_effect
def test_units_parse(effect: Effect) -> None:
    for p in effect.parameters:
        assert parse_quantity(f"1 {p.unit}", p.unit) > 0.0


@every_effect
def test_bounds_hold_null_and_typical_values(effect: Effect) -> None:
    for p in effect.parameters:
        size = p.range_on(FACTS)
        assert -math.inf < size.lower < size.upper < math.inf
        assert size.typical
        assert all(size.lower <= value <= size.upper for value in size.typical)
        assert len(set(size.typical)) == len(p.typical)
        if isinstance(p.null, float) and p.null < math.inf:
            assert size.lower <= p.null <= size.upper
            assert p.null not in size.typical


@st.composite
def any_rig(draw: st.DrawFn) -> RigQuantities:
    """A rig of any size, of which any quantities are unknown; its supply is above ambient, its range of x a range."""
    size = st.one_of(st.just(math.nan), st.floats(-9.0, 9.0).map(lambda power: 10.0**power))
    known = RigQuantities(**{field.name: draw(size) for field in fields(RigQuantities)})
    low = draw(st.floats(-1.0, 1.0))
    return replace(
        known, supply=known.ambient + known.supply, x_min=low, x_max=low + known.x_max, heat_capacity_ratio=1.4
    )


@settings(max_examples=100, deadline=None)
@given(any_rig())
def test_bounds_are_finite_and_ordered_wherever_an_effect_can_be_fitted(rig: RigQuantities) -> None:
    for p in [*BASE_PARAMETERS.values(), *(p for e in EFFECTS for p in e.parameters)]:
        size = p.range_on(rig)
        if size.typical:
            assert -math.inf < size.lower < size.upper < math.inf, p
            assert all(size.lower <= value <= size.upper for value in size.typical), p


@every_effect
def test_places_move_with_the_zero_of_x_and_sizes_do_not(effect: Effect) -> None:
    moved = replace(FACTS, x_min=FACTS.x_min - 2.0, x_max=FACTS.x_max - 2.0)
    for p in effect.parameters:
        (lower, upper, typical, _), (new_lower, new_upper, new_typical, _) = p.range_on(FACTS), p.range_on(moved)
        shifts = np.array([new_lower, new_upper, *new_typical]) - np.array([lower, upper, *typical])
        assert np.ptp(shifts) < 1e-6, p  # rounding
        assert min(abs(shifts[0]), abs(shifts[0] + 2.0)) < 1e-6, p


def test_a_bound_without_a_scale_is_far_from_what_is_typical() -> None:
    sized = Parameter("size", "N", None, "0.1 supply forces", "2 supply forces", (3.0, 5.0))
    signed = Parameter("size", "N", 0.0, "-2 supply forces", "2 supply forces", (3.0, 5.0))
    unknown = RigQuantities()
    assert sized.range_on(unknown)[:2] == pytest.approx((3e-3, 5e3))
    assert signed.range_on(unknown)[:2] == pytest.approx((-5e3, 5e3))


@every_effect
def test_every_effect_has_all_texts(effect: Effect) -> None:
    for text in (effect.title, effect.equation, effect.looks_like, effect.shows_over, effect.separate, effect.source):
        assert text.strip()
    assert all(p.title for p in effect.parameters)
    assert inspect.getmodule(next(iter(effect.ports.values()))).__doc__


@every_effect
def test_ports_take_their_arguments_and_then_the_parameters(effect: Effect) -> None:
    for name, function in effect.ports.items():
        signature = list(inspect.signature(function).parameters)
        assert signature[: len(PORTS[name].arguments)] == list(PORTS[name].arguments)
        own = signature[len(PORTS[name].arguments) :]
        declared = [p.name for p in effect.parameters]
        # "from" and "to" are no names in Python
        assert [{"start": "from", "end": "to"}.get(n, n) if "from" in declared else n for n in own] == declared
        assert function.__doc__
        assert function.__doc__.strip().splitlines()[0].endswith(".")


def test_twins_are_effects_of_the_catalogue_and_others_than_the_effect() -> None:
    for effect in EFFECTS:
        assert set(effect.twins) <= set(catalogue()) - {effect.name}


@pytest.mark.parametrize(
    "effect", [e for e in EFFECTS if any(p.null not in (None, math.inf) for p in e.parameters)], ids=lambda e: e.name
)
def test_at_null_the_effect_is_absent(effect: Effect) -> None:
    for experiment in runs(effect):
        with_it, without = simulated(effect, nulls(effect), experiment), absent(effect, experiment)
        assert with_it == pytest.approx(without, rel=1e-12, abs=1e-15)


def test_which_effects_are_present_at_their_null() -> None:
    """Heat transfer, a pump and a pressure loop always; of a Stribeck rise hysteresis takes one branch."""
    assert {e.name for e in EFFECTS if not e.nested} == {"heat-transfer", "pressure-control", "pump-flow"}
    pairs = {(e.name, o.name) for e in EFFECTS for o in EFFECTS if e.in_model_with((e, o)) is not e}
    assert pairs == {("friction-hysteresis", "stribeck")}
    known = catalogue()
    beside = known["friction-hysteresis"].in_model_with([known["stribeck"]])
    assert not beside.nested
    assert all(p.null is None for p in beside.parameters)
    assert known["friction-hysteresis"].nested


@every_effect
def test_at_null_every_port_is_neutral(effect: Effect) -> None:
    """So beside any other effect nothing changes, but where a port's presence alone does."""
    if not effect.nested or any(p.null == math.inf for p in effect.parameters):
        return  # heat transfer, a pump, a stiff regulator, rigid bristles: not absent at a finite value
    own = [nulls(effect)[f"{effect.name}.{p.name}"] for p in effect.parameters]
    samples = {"u": 2.0, "s": 2.0, "h": 1e-3, "b": 0.528, "coulomb": FRICTION["friction.coulomb"]}
    for port, function in effect.ports.items():
        arguments = [samples.get(a, 0.1 if a in ("x", "v") else 1.0) for a in PORTS[port].arguments]
        found = function(*arguments, *own)
        neutral = {"sum": 0.0, "factor": 1.0, "chain": arguments[0] if arguments else 0.0}
        value = found[0] if PORTS[port].combine == "state" else found  # type: ignore[index]
        assert value == pytest.approx(neutral.get(PORTS[port].combine, arguments[0] if arguments else 0.0)), port


def test_hysteresis_without_a_drop_changes_friction_beside_stribeck() -> None:
    at_null = STRIBECK | {"friction-hysteresis.drop": 0.0}
    experiment = make_experiment("friction", TIME, {"p1": FILL, "p2": 3e5})
    both = run(model(["stribeck", "friction-hysteresis"], VESSEL_VOLUME | at_null), experiment)
    alone = run(model(["stribeck"], VESSEL_VOLUME | STRIBECK), experiment)
    assert np.abs(both - alone)[:, at.V].max() > 1e-5


def test_hysteresis_has_a_viscous_constant_of_its_own_while_slowing() -> None:
    """Nouri (3.7): 14 N and 45 N s/m; while slowing 30 % of the one and half of the other are lost."""
    values = STRIBECK | {"friction-hysteresis.drop": 0.3, "friction-hysteresis.viscous_drop": 0.5}
    fitted = model(["stribeck", "friction-hysteresis"], values)
    kernel = build(fitted.effects, compiled=False)
    th, on = kernel.effect_vector(fitted.effect_values()), kernel.effect_switches([e.name for e in fitted.effects])
    base = base_vector(fitted, make_experiment("friction", TIME, {}))
    levels = kernel.functions.friction_levels(1.0, 0.1, 0.1, 1e5, 1e5, base, th, on)
    assert levels[0] == pytest.approx(14.0 + 8.0 / (1.0 + (0.1 / 0.015) ** 2))
    assert levels[1] + 45.0 * 0.1 == pytest.approx(0.7 * 14.0 + 0.5 * 45.0 * 0.1)
    refined = model(["friction-hysteresis"], {"friction-hysteresis.drop": 0.3})
    assert refined.effect_values() == {"friction-hysteresis.drop": 0.3, "friction-hysteresis.viscous_drop": 0.0}
    assert fitted.effect_parameters(fitted.effects[1]) == [0.3, 0.5]


@pytest.mark.parametrize(
    ("name", "value"),
    [("supply-droop", "regulator_conductance"), ("presliding", "stiffness"), ("heat-transfer", "conductance")],
)
def test_effects_without_a_finite_null_vanish_at_the_end_of_their_bounds(name: str, value: str) -> None:
    """A stiff regulator, rigid bristles; heat transfer reaches the isothermal chamber, not the base model's."""
    effect = catalogue()[name]
    upper = next(p.range_on(FACTS).upper for p in effect.parameters if p.name == value)
    for experiment in runs(effect):
        near = simulated(effect, typical_values([effect]) | {f"{name}.{value}": upper}, experiment)
        without = absent(effect, experiment)
        if name == "heat-transfer":
            assert np.abs(near[:, at.GAS_T] - RIG.gas_temperature).max() < 10.0
        else:
            for column, least in ((at.X, 1e-6), (at.P1, 1.0)):
                moved = np.ptp(without[:, column])
                assert np.abs(near - without)[:, column].max() < 5e-3 * moved + least


@every_effect
def test_typical_values_have_an_influence(effect: Effect) -> None:
    """Somewhere the effect changes what is compared, by more than rounding."""
    changes = []
    for experiment in runs(effect):
        out, without = simulated(effect, typical_values([effect]), experiment), absent(effect, experiment)
        shown = [at.X, at.A, at.R1, at.R2, at.GAS_T]
        changes.append(np.abs(out - without)[:, shown].max(axis=0) / np.array([1e-6, 1e-3, 1.0, 1.0, 1e-3]))
    assert np.max(changes) > 1.0


@every_effect
def test_finite_at_the_corners_of_the_bounds(effect: Effect) -> None:
    for values in (typical_values([effect]), *corners(effect)):
        for experiment in runs(effect):
            assert np.all(np.isfinite(simulated(effect, values, experiment))), (values, experiment.recording.experiment)


@settings(max_examples=60, deadline=None)
@given(
    effect=st.sampled_from([e for e in EFFECTS if e.part == "cylinder"]),
    corner=st.integers(0, 8),
    v=st.floats(-1.0, 1.0),
    x=st.floats(0.0, 0.2),
    p1=st.floats(1e5, 1.5e6),
    p2=st.floats(1e5, 1.5e6),
)
def test_friction_never_adds_energy(effect: Effect, corner: int, v: float, x: float, p1: float, p2: float) -> None:
    """Wherever the parameters stand in their bounds, dry and viscous friction oppose motion."""
    values = [*corners(effect), typical_values([effect])]
    kernel = build((effect,), compiled=False)
    th, on = tuple(kernel.effect_vector(values[corner % len(values)])), (1, 0)
    base = tuple(base_vector(model(), make_experiment("friction", TIME, {})))
    direction = 1.0 if v > 0 else -1.0
    rising, falling = kernel.functions.friction_levels(direction, abs(v), x, p1, p2, base, th, on)
    viscous = base[at.VISCOUS] * kernel.functions.viscous_factor(direction, th, on) * abs(v)
    assert 0.0 < falling + viscous <= rising + viscous
    assert kernel.functions.viscous_factor(direction, th, on) >= 0.0
    assert kernel.functions.static_factor(1.0, th, on) >= 1.0


def test_the_dead_band_means_the_same_in_the_catalogue_and_in_the_exams_rig() -> None:
    """The rig's truth, put into the catalogue's effect, opens the valve at the same commands as the rig does."""
    rig = Parameters(overlap=0.4)
    width = BY_NAME["valve-deadband"].true_parameters(rig)["width"]
    command = catalogue()["valve-deadband"].ports["command"]
    for u in np.linspace(-1.0, 1.0, 201):
        assert (command(u, 0.0, 1e-3, width)[0] != 0.0) == (valve_area(rig, u, 0.0) != 0.0)


PLUGIN = """
from pneucli.physics.declaration import Effect, Parameter

def force(x, v, stroke, gain):
    "Drag in N."
    return -gain * v * abs(v)

EFFECT = Effect("drag", "Drag", "cylinder", (Parameter("gain", "kg/m", 0.0, 0.0, 1e3, (10.0,)),), {"force": force},
                "", "", "v", (), "", "")
"""


def test_a_plugin_joins_the_catalogue(tmp_path: Path) -> None:
    (tmp_path / "drag.py").write_text(PLUGIN)
    known = all_effects([tmp_path / "drag.py"])
    assert set(known) - set(all_effects([])) == {"drag"}
    assert set(catalogue()) <= set(known)
    assert [e.name for e in select_effects(["drag", "stribeck"], known)] == ["drag", "stribeck"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such Python file"),
        ("x = 1", "declares no EFFECT"),
        ("EFFECT = 3", "declares no EFFECT"),
        ("import nothing_of_that_name", "does not run"),
        ("def force(:", "does not run"),
        (PLUGIN.replace('{"force"', '{"farce"'), 'did you mean "force"'),
        (PLUGIN.replace('{"force"', '{"drive"'), 'acts nowhere without the port "command"'),
    ],
    ids=["absent", "empty", "no effect", "import", "syntax", "port", "port alone"],
)
def test_a_bad_plugin_says_what_is_wrong(tmp_path: Path, text: str | None, message: str) -> None:
    file = tmp_path / "own.py"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        load_plugin(file)
    assert str(file) in error.value.where


def test_an_unknown_effect_is_refused_with_the_closest_name() -> None:
    with pytest.raises(InputError, match='did you mean "stribeck"'):
        select_effects(["stribek"], catalogue())


@pytest.mark.parametrize("roundness", [0.0, 1.0, 2.0])
def test_the_spool_is_a_filter_of_second_order(roundness: float) -> None:
    lag, step, time = catalogue()["valve-lag"], 2e-4, 5e-3
    states, opened = (0.0, 0.0), []
    for _ in range(200):
        _, states = opening_after(lag, 1.0, states, step, (time, roundness))
        opened.append(states[0])
    exact = lti([1.0], [0.25 * roundness * time**2, time, 1.0]).step(T=step * np.arange(201))[1]
    assert opened == pytest.approx(exact[1:], abs=0.005)
