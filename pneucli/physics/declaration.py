"""How a physical effect is declared: its name, parameters, equations at the simulator's ports, and description.

A declaration is the only place that describes an effect. The simulator's code, the fit's parameter vector, the
diagnosis, the catalogue, the page of the documentation and the tests are made from it. A port's function takes the
arguments of the port (:data:`pneucli.physics.ports.PORTS`) and then the effect's parameters in their order; it uses
scalars, ``math`` and the functions of :mod:`pneucli.physics.gas` only, since the kernel compiles its source.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from pneucli.errors import InputError
from pneucli.experiments import Part
from pneucli.physics.ports import PORTS, Balance
from pneucli.physics.scales import SCALES, Quantity, RigQuantities, parse_scaled, value_of

MAX_TYPICAL_RATIO = 1000.0  # of a bound to a typical value, where the rig does not determine the bound


class ParameterRange(NamedTuple):
    """Bounds, typical values and step of a parameter on one rig, in its unit; no typical values without a scale."""

    lower: float
    upper: float
    typical: tuple[float, ...]
    step: float


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Each size is a number in ``unit``, or a number of a scale of the rig such as "0.2 supply forces"
    (:data:`pneucli.physics.scales.SCALES`).

    Attributes:
        name: Name of the parameter, an identifier.
        unit: Its unit.
        null: The value at which the effect vanishes: a number (``inf``: it vanishes as the parameter grows), the name
            of a base parameter that has this value, or None where the parameter alone cannot make it vanish.
        lower: Lower bound.
        upper: Upper bound.
        typical: Plausible values; a fit starts from each.
        title: Meaning in words.
        step: Smallest change with an effect on the residual, where the effect is not smooth in the parameter.
        direct: Name under which the balance of forces or the flow into the chambers gives a start of its own
            (:func:`pneucli.identify.guesses.direct_friction.direct_friction`,
            :data:`pneucli.identify.estimation.score_test.LATENESS`).
        refines: Whether it stays at ``unrefined`` until a fit shows that it differs or the pipeline file states it.
        unrefined: The value of a parameter that refines the effect and makes nothing vanish; None: its null.
        needs: Signals without which a parameter that refines the effect does not show.
        widens_overlap: Whether a resting valve opens later by its value, which a model without the effect takes for
            overlap.
        multiplies: The base parameter whose product with this one acts, with the parameters that have it as their
            null; the parameter is then a ratio
            (:func:`pneucli.identify.estimation.fit.ratio_interval`), and its null is 0.

        stated: What a pipeline file may state of it outside ``[model]`` (:mod:`pneucli.config.pipeline_tables`).

    Raises:
        UnitError: A size is neither a number nor a number of a known scale of the right dimension.
    """

    name: str
    unit: str
    null: float | str | None
    lower: Quantity
    upper: Quantity
    typical: tuple[Quantity, ...]
    title: str = ""
    step: Quantity = 0.0
    direct: str | None = None
    refines: bool = False
    unrefined: float | None = None
    needs: frozenset[str] = frozenset()
    widens_overlap: bool = False
    multiplies: str | None = None
    stated: str = ""

    def __post_init__(self) -> None:
        for quantity in (self.lower, self.upper, *self.typical, self.step):
            if isinstance(quantity, str):
                parse_scaled(quantity, self.unit)

    @property
    def value_unrefined(self) -> float | None:
        """The value that it has until it is fitted or stated; None where it always has one of its own."""
        if not self.refines:
            return None
        return self.null if isinstance(self.null, float) else self.unrefined

    def range_on(self, facts: RigQuantities) -> ParameterRange:
        """Return the parameter's numbers on a rig.

        A bound whose scale is missing is ``MAX_TYPICAL_RATIO`` times beyond the typical values; without them, too, it
        is infinite.

        >>> lower, upper, typical, _ = Parameter("force", "N", 0.0, 0.0, "1 supply forces", (20.0,)).range_on(
        ...     RigQuantities(force=500.0)
        ... )
        >>> lower, upper, typical
        (0.0, 500.0, (20.0,))
        """
        lower, upper, step, *typical = (
            value_of(q, self.unit, facts) for q in (self.lower, self.upper, self.step, *self.typical)
        )
        complete = bool(typical) and not any(map(math.isnan, typical))
        sizes = [abs(t) for t in typical] if complete else [math.inf]
        if math.isnan(lower):
            is_positive = complete and not str(self.lower).startswith("-")
            lower = min(sizes) / MAX_TYPICAL_RATIO if is_positive else -max(sizes) * MAX_TYPICAL_RATIO
        upper = max(sizes) * MAX_TYPICAL_RATIO if math.isnan(upper) else upper
        return ParameterRange(
            lower,
            upper,
            tuple(min(max(t, lower), upper) for t in typical) if complete else (),
            0.0 if math.isnan(step) else step,
        )


@dataclass(frozen=True)
class Untold:
    """What most rigs have of an effect, though their models may lack it.

    Attributes:
        draw: Returns the parameters of one such rig in their units, by a generator of random numbers and the rig.
        apart: Effects beside which it adds nothing.
    """

    draw: Callable[[np.random.Generator, RigQuantities], dict[str, float]]
    apart: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Effect:
    """One physical effect.

    Attributes:
        name: Name in files and answers.
        title: Name in words.
        part: The part of the rig in which it acts.
        parameters: Its parameters, in the order in which its functions take them.
        ports: Functions by names of :data:`pneucli.physics.ports.PORTS`.
        equation: Plain text with LaTeX between dollars.
        looks_like: Its trace in the residual.
        shows_over: The signal over which this trace is clearest.
        twins: Effects that ordinary recordings confound with it.
        separate: The experiment that separates it from them.
        source: Where the equation comes from.
        order: Rank among the effects of a chained port.
        nested: Whether the base model is this effect at the null values.
        side: Chamber on which a variant acts (:mod:`pneucli.physics.sides`); None for the declaration itself.
        needs: Signals without which it cannot show, or the variant equals the declaration.
        untold: What most rigs have of it; None: nothing.
    """

    name: str
    title: str
    part: Part
    parameters: tuple[Parameter, ...]
    ports: dict[str, Callable[..., object]]
    equation: str
    looks_like: str
    shows_over: str
    twins: tuple[str, ...]
    separate: str
    source: str
    order: int = 0
    nested: bool = True
    side: Literal[1, 2] | None = None
    needs: frozenset[str] = frozenset()
    untold: Untold | None = None

    @property
    def main_parameters(self) -> tuple[Parameter, ...]:
        """The parameters without which the effect is not described."""
        return tuple(p for p in self.parameters if not p.refines)

    @property
    def leading_parameter(self) -> Parameter:
        """The parameter that states the size of the effect: the first with a null, else the first."""
        return next((p for p in self.parameters if p.null is not None), self.parameters[0])

    def in_model_with(self, effects: Iterable[Effect]) -> Effect:
        """Return the declaration as it holds in a model with other effects.

        Beside some, no value of the parameters makes the effect absent. Friction with two branches is an example:
        without a drop, the Stribeck rise still holds on one of them alone.

        Args:
            effects: The effects of the model; this one may be among them.

        Returns:
            The effect itself, or a copy that is not nested and whose parameters have no nulls.

        """
        taken = {port for other in effects if other.name != self.name for port in other.ports}
        if not any(taken.intersection(PORTS[port].distinct_with) for port in self.ports):
            return self
        return replace(self, parameters=tuple(replace(p, null=None) for p in self.parameters), nested=False)

    @property
    def balances(self) -> frozenset[Balance]:
        """The balances in which it acts."""
        return frozenset(PORTS[port].balance for port in self.ports)

    @property
    def sensors(self) -> frozenset[str]:
        """The signals whose sensors it is a fault of."""
        return frozenset(port.removeprefix("read_") for port in self.ports if port.startswith("read_"))

    @property
    def is_set_valued(self) -> bool:
        """Whether it predicts an interval of forces in place of one force."""
        return any(PORTS[port].is_set_valued for port in self.ports)

    def missing_scale_error(self, facts: RigQuantities) -> InputError:
        """Return the error for a rig whose quantities leave a scale of the effect undefined."""
        unscaled = [p for p in self.parameters if not p.range_on(facts).typical]
        names = {quantity.partition(" ")[2] for p in unscaled for quantity in p.typical if isinstance(quantity, str)}
        scales = "; ".join(f"{name}: {SCALES[name].meaning}" for name in sorted(names))
        found = f"{self.title} has no scale on this rig ({scales})"
        return InputError(
            "[rig]", found, "the quantities of this scale", f'state them in [rig], or remove "{self.name}"', code="E063"
        )


def consists_of_times(effect: Effect) -> bool:
    """Return whether all main parameters are delays or time constants, at 0 s of which the effect is absent.

    Args:
        effect: An effect of the catalogue or of a plug-in.

    Returns:
        Whether every parameter that does not refine it is in s with a null of 0.

    >>> from pneucli.physics.effects import catalogue
    >>> consists_of_times(catalogue()["line-delay"]), consists_of_times(catalogue()["stribeck"])
    (True, False)
    """
    return all((p.unit, p.null) == ("s", 0.0) for p in effect.main_parameters)


_AREA = ("m^2", None, "0.01 bore areas", "100 bore areas", ("1 bore areas",))
_DEAD = ("m^3", None, "1e-3 chamber volumes", "10 chamber volumes", ("0.1 chamber volumes",))

BASE_PARAMETERS: dict[str, Parameter] = {
    "friction.coulomb": Parameter("coulomb", "N", None, 0.0, "2 supply forces", ("0.02 supply forces",)),
    "friction.viscous": Parameter(
        "viscous", "N s/m", None, 0.0, "1000 supply forces per top speed", ("0.02 supply forces per top speed",)
    ),
    "rig.moving_mass": Parameter(
        "moving_mass", "kg", None, "1e-6 driven masses", "100 driven masses", ("1e-5 driven masses",)
    ),
    "rig.piston_area_1": Parameter("piston_area_1", *_AREA),
    "rig.piston_area_2": Parameter("piston_area_2", *_AREA),
    "rig.dead_volume_1": Parameter("dead_volume_1", *_DEAD),
    "rig.dead_volume_2": Parameter("dead_volume_2", *_DEAD),
    "rig.vessel_volume": Parameter(
        "vessel_volume", "m^3", None, "1e-3 dead volumes", "1e3 dead volumes", ("1 dead volumes",)
    ),
    "rig.supply_pressure": Parameter(
        "supply_pressure", "Pa", None, "0.01 supply pressures", "10 supply pressures", ("1 supply pressures",)
    ),
    "rig.polytropic_exponent": Parameter("polytropic_exponent", "1", None, 1.0, 5.0 / 3.0, (1.2,)),
    "valve.effective_area": Parameter(
        "effective_area", "m^2", None, "1e-9 bore areas", "10 bore areas", ("1e-3 bore areas",)
    ),
    "valve.overlap": Parameter("overlap", "V", 0.0, 0.0, "1 full commands", ("0.01 full commands",)),
}
