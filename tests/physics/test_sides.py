"""One declaration for both chambers: where its variants enter, and what they say."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.physics.effects import all_effects, catalogue, catalogue_with_sides
from pneucli.physics.ports import PORTS
from pneucli.physics.sides import declared_name, variants
from pneucli.simulate.model import Model
from pneucli.simulate.run import simulate
from tests.simulate.synthetic_experiments import FRICTION, VALVE, make_experiment, time_grid


@pytest.mark.parametrize(
    ("name", "ports"),
    [
        ("chamber-leak:2", {"leak_2_ambient"}),
        ("laminar-leak:2", {"leak_2_ambient"}),
        ("dead-volume:2", {"volume_2"}),
        ("pressure-offset:2", {"read_p2", "unread_p2"}),
        ("line-delay:1", {"flow_delay_1", "hose_bore_1"}),
        ("line-delay:2", {"flow_delay_2", "hose_bore_2"}),
        ("pressure-scale:1", {"read_p1", "unread_p1"}),
        ("pressure-scale:2", {"read_p2", "unread_p2"}),
    ],
)
def test_a_variant_enters_at_the_ports_of_its_side(name: str, ports: set[str]) -> None:
    variant, declared = catalogue_with_sides()[name], catalogue()[declared_name(name)]
    assert set(variant.ports) == ports
    assert set(variant.ports.values()) <= set(declared.ports.values())
    assert variant.parameters == declared.parameters
    assert variant.side == int(name[-1])


def test_what_stands_at_no_chamber_has_no_variant() -> None:
    sided = {declared_name(name) for name in catalogue_with_sides().keys() - catalogue().keys()}
    for effect in catalogue().values():
        assert (effect.name in sided) == bool(variants(effect))
    assert not sided & {"stribeck", "heat-transfer", "valve-leak", "piston-leak", "acceleration-bias", "extra-mass"}
    assert all(port in PORTS for effect in catalogue_with_sides().values() for port in effect.ports)


def test_a_variant_speaks_of_its_chamber() -> None:
    known = catalogue_with_sides()
    assert known["chamber-leak:2"].title == "Leak of chamber 2 to ambient"
    assert "p_2" in known["chamber-leak:2"].equation
    assert "p_1" not in known["chamber-leak:2"].equation
    assert known["dead-volume:2"].equation == "$V_2 = V_{02} + V_{add} + A_2 (L - x)$"
    assert "leaving chamber 2" in known["laminar-leak:2"].equation
    assert known["pressure-offset:2"].shows_over == "p2"
    assert known["pressure-scale:2"].title.endswith("p2 alone")


def test_the_declared_effects_are_as_they_were() -> None:
    assert all(all_effects()[name] is effect for name, effect in catalogue().items())
    assert all(effect.side is None for effect in catalogue().values())


@pytest.mark.parametrize(
    ("signals", "chamber_2", "shown"),
    [
        ({"u", "p1", "x"}, "open", {"chamber-leak", "line-delay", "pressure-scale", "pressure-offset"}),
        (
            {"u", "p1", "x"},
            "closed",
            {"chamber-leak", "chamber-leak:2", "line-delay", "pressure-scale", "pressure-offset"},
        ),
        (
            {"u", "p1", "p2", "x"},
            "valve",
            {"chamber-leak", "chamber-leak:2", "pressure-scale", "pressure-scale:1", "pressure-scale:2"}
            | {"pressure-offset", "pressure-offset:2", "line-delay", "line-delay:1", "line-delay:2"},
        ),
        (
            {"u", "p1", "p2", "x", "a"},
            "open",
            {"chamber-leak", "pressure-scale", "pressure-scale:1", "pressure-scale:2", "acceleration-bias"}
            | {"pressure-offset", "pressure-offset:2", "line-delay"},
        ),
    ],
)
def test_an_effect_can_show_where_its_chamber_is_shut_and_its_sensor_recorded(
    signals: set[str], chamber_2: str, shown: set[str]
) -> None:
    e = make_experiment("axis", time_grid(0.1), dict.fromkeys(signals, 0.0), chamber_2=chamber_2)
    raw = {name: values for name, values in e.raw.items() if name in signals}
    e = replace(e, raw=raw)
    asked = {"chamber-leak", "line-delay", "pressure-scale", "pressure-offset", "acceleration-bias"}
    found = {n for n, effect in catalogue_with_sides().items() if declared_name(n) in asked and e.can_show(effect)}
    assert found == shown


@pytest.mark.parametrize("chamber", [1, 2])
def test_a_hose_delays_the_flow_of_its_own_chamber(chamber: int) -> None:
    """Both chambers are filled from 10 ms on; through a hose of 20 ms one begins that much later."""
    time = time_grid(0.08)
    signals = {"u": np.where(time < 0.01, 0.0, 5.0), "u2": np.where(time < 0.01, 0.0, 5.0), "x": 0.1, "v": 0.0}
    e = make_experiment("axis", time, signals, chamber_2="valve").without_mechanics()
    name = f"line-delay:{chamber}"
    delayed = replace(
        Model(e.rig, (catalogue_with_sides()[name],), {**FRICTION, f"{name}.delay": 0.02}, VALVE), valve_2=VALVE
    )
    plain = Model(e.rig, (), FRICTION, VALVE, VALVE)
    for side in (1, 2):
        late, soon = simulate(delayed, e)[f"p{side}"], simulate(plain, e)[f"p{side}"]
        shift = 20 if side == chamber else 0
        assert late[shift:] == pytest.approx(soon[: soon.size - shift], rel=1e-3)
