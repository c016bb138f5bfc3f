"""A model: the rig, the active effects, and the value of every parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pneucli.experiments import Part
from pneucli.physics.declaration import Effect, Parameter
from pneucli.physics.gas import critical_ratio_of
from pneucli.recording import Rig
from pneucli.simulate.layout import BASE_NAMES
from pneucli.simulate.valve_forms import NO_VALVE, LinearValve, SwitchingValve, ValveArea

ValveForm = ValveArea | LinearValve | SwitchingValve


@dataclass(frozen=True)
class Model:
    """A rig, active effects, the valve's area, and values by name, SI.

    Attributes:
        rig: The rig; its values are those of base parameters that ``values`` omits.
        effects: Effects that are on.
        values: Values of base parameters (:data:`pneucli.simulate.layout.BASE_NAMES`) and of EFFECT.PARAMETER, the
            latter in the unit of the catalogue.
        valve: Effective areas of the paths of chamber 1.
        valve_2: Those of chamber 2 where they differ from chamber 1; None: the same.
    """

    rig: Rig
    effects: tuple[Effect, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    valve: ValveForm = NO_VALVE
    valve_2: ValveForm | None = None

    def __post_init__(self) -> None:
        if fixed := {name: k.fixed for name, k in self.rig.priors.items() if k.fixed is not None}:
            second = None if self.valve_2 is None else self.valve_2.with_parameters(fixed)
            for name, value in (("values", {**self.values, **fixed}), ("valve_2", second)):
                object.__setattr__(self, name, value)
            object.__setattr__(self, "valve", self.valve.with_parameters(fixed))

    @property
    def valves(self) -> tuple[ValveForm, ...]:
        """The valves that have parameters."""
        return (self.valve,) if self.valve_2 is None else (self.valve, self.valve_2)

    @property
    def lacking_parts(self) -> frozenset[Part]:
        """Parts that the rig has not."""
        lacking: dict[Part, bool] = {
            "pump": self.rig.source != "pump",
            "pressure valve": self.rig.valve_kind != "pressure",
            "switching valve": self.valve.form != "switching",
        }
        return frozenset(part for part, is_lacking in lacking.items() if is_lacking)

    @property
    def excluded_parts(self) -> frozenset[Part]:
        """Parts whose effects cannot be missing: the valve's form contains them, or the rig has no such part."""
        return self.valve.covers | self.lacking_parts

    def valve_parameters(self) -> dict[str, tuple[float, str]]:
        """Return value and unit of the parameters of the valves by name."""
        return {name: value for valve in self.valves for name, value in valve.parameters().items()}

    @property
    def chamber_2_valve(self) -> ValveForm:
        """The paths of chamber 2; the same as those of chamber 1 without data of their own."""
        return self.valve if self.valve_2 is None else self.valve_2

    def valve_of_chamber(self, chamber: int) -> ValveForm:
        """Return the paths of chamber 1 or 2."""
        return self.chamber_2_valve if chamber == 2 else self.valve

    def base_values(self) -> dict[str, float]:
        """Return every base parameter's value."""
        return dict(self._base_values)

    @cached_property
    def _base_values(self) -> dict[str, float]:
        return _base_values_of_rig(self.rig) | {name: v for name, v in self.values.items() if name in BASE_NAMES}

    def effect_values(self) -> dict[str, float]:
        """Return the values of the effects' parameters by EFFECT.PARAMETER."""
        return {f"{e.name}.{p.name}": self._value(e, p) for e in self.effects for p in e.parameters}

    def effect_parameters(self, effect: Effect) -> list[float]:
        """Return the values of one effect's parameters, in the order of its declaration."""
        return [self._value(effect, p) for p in effect.parameters]

    def _value(self, effect: Effect, parameter: Parameter) -> float:
        """Return the value of an effect's parameter; one that refines the effect may have none in this model."""
        name, unrefined = f"{effect.name}.{parameter.name}", parameter.value_unrefined
        return self.values[name] if unrefined is None else self.values.get(name, unrefined)

    def sum_of_port(self, port: str, *arguments: float) -> float:
        """Return the sum of the effects at a port, for the port's arguments."""
        users = [e for e in self.effects if port in e.ports]
        return float(sum(e.ports[port](*arguments, *self.effect_parameters(e)) for e in users))  # type: ignore[misc]

    def chain_of_port(self, port: str, value: float, *more: float) -> float:
        """Return a value mapped by the effects of a chained port; ``more`` holds the port's other arguments."""
        for effect in sorted(self.effects, key=lambda e: (e.order, e.name)):
            if port in effect.ports:
                value = float(effect.ports[port](value, *more, *self.effect_parameters(effect)))  # type: ignore[arg-type]
        return value

    def with_values(self, values: Mapping[str, float]) -> Model:
        """Return the model with some values replaced."""
        return replace(self, values={**self.values, **values})


def _base_values_of_rig(rig: Rig) -> dict[str, float]:
    """Return the base parameters of a rig.

    >>> _base_values_of_rig(Rig(stroke=0.2))["rig.upper_end"]
    0.2
    """
    area_1 = rig.piston_area_1 or 0.0
    return {
        "friction.coulomb": 0.0,
        "friction.viscous": 0.0,
        "rig.moving_mass": rig.moving_mass or 1.0,
        "rig.piston_area_1": area_1,
        "rig.piston_area_2": area_1 if rig.piston_area_2 is None else rig.piston_area_2,
        "rig.stroke": rig.stroke or np.inf,
        "rig.dead_volume_1": rig.dead_volume_1 or 0.0,
        "rig.dead_volume_2": rig.dead_volume_2 or 0.0,
        "rig.ambient_pressure": rig.ambient_pressure,
        "rig.supply_pressure": rig.supply_pressure or np.nan,
        "rig.gas_temperature": rig.gas_temperature,
        "rig.heat_capacity_ratio": rig.heat_capacity_ratio,
        "rig.polytropic_exponent": rig.polytropic_exponent or rig.heat_capacity_ratio,
        "rig.gas_constant": rig.gas_constant,
        "valve.critical_ratio": critical_ratio_of(rig.heat_capacity_ratio),
        "rig.wall_temperature": rig.gas_temperature,
        "valve.null": rig.valve_null,
        "rig.lower_end": 0.0,
        "rig.upper_end": rig.stroke or np.inf,
    }


def parameter_value(model: Model, name: str) -> float:
    """Return the value of a parameter of any kind.

    Args:
        model: The model.
        name: Name of the parameter.

    Returns:
        Its value in its unit.

    Raises:
        KeyError: The model has no such parameter.
    """
    named = model.valve_parameters()
    if name in named:
        return named[name][0]
    return model.values[name] if name in model.values else model.base_values()[name]


def has_parameter(model: Model, name: str) -> bool:
    """Return whether a model has a parameter.

    Args:
        model: The model.
        name: Name of the parameter.

    Returns:
        Whether it is a parameter of the valves, the base model, or an effect.
    """
    return name in model.valve_parameters() or name in model.base_values() or name in model.values


def without_effect(model: Model, name: str) -> Model:
    """Return a model without one of its effects."""
    return replace(model, effects=tuple(e for e in model.effects if e.name != name))


def with_parameters(model: Model, values: dict[str, float]) -> Model:
    """Return a model with parameters of any kind replaced.

    Args:
        model: The model.
        values: New values by name (SI).

    Returns:
        The new model.
    """
    valves = model.valve_parameters()
    rest = {name: v for name, v in values.items() if name not in valves}
    if len(rest) == len(values):
        return model.with_values(rest)
    second = None if model.valve_2 is None else model.valve_2.with_parameters(values)
    valve = model.valve.with_parameters(values)
    return replace(model, values={**model.values, **rest}, valve=valve, valve_2=second)


def with_effect(model: Model, effect: Effect, values: dict[str, float]) -> Model:
    """Return a model with an effect switched on.

    Args:
        model: The model.
        effect: The effect.
        values: Values of its parameters by EFFECT.PARAMETER, each in the unit that the effect declares; those of other
            parameters of any kind may be among them.

    Returns:
        The new model.
    """
    others = tuple(e for e in model.effects if e.name != effect.name)
    kept = {name: value for name, value in model.values.items() if not name.startswith(f"{effect.name}.")}
    return with_parameters(replace(model, values=kept, effects=(*others, effect)), values)
