"""One recording seen through one subsystem: what every view has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pneucli.identify.guesses.chamber_balance import Chamber
from pneucli.identify.guesses.flow_paths import opening_from_null
from pneucli.physics.declaration import Effect, Side
from pneucli.quantities import SIGNALS
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from pneucli.simulate.noise_propagation import sample_deviations

Array = NDArray[np.float64]

MAX_RESIDUAL = 1e9  # times the noise: more than any model errs that does not run away


@dataclass(frozen=True)
class DiscrepancyTerm:
    """As what something that a model lacks may act in one channel: its ``name``, its ``unit``, and what one such unit
    is over time (n,).

    ``to_residual`` takes courses of it (k, n) to what they make of the residual, (k, n) in units of noise, to first
    order. It may be a function of any signal, or of the one that is its ``argument`` one. ``modelled`` (n,) is that
    signal as the model has it: of what was measured, what the model lacks is a part, which would explain itself.
    """

    name: str
    unit: str
    unit_signal: Array
    to_residual: Callable[[Array], Array]
    argument: str | None = None
    modelled: Array | None = None


@dataclass(frozen=True)
class ResidualModel(ABC):
    """One experiment seen through one subsystem.

    ``title`` names the subsystem to people, ``sides`` the balances in which an effect must stand to show,
    ``base_groups`` the groups of base parameters that matter. ``predicts_force``: an error of it is one of a force.
    ``is_simulated``: it is simulated from each restart on, so that errors grow until the next. ``weights`` by channel
    (1 where there is none) say how much a fit counts a residual.
    """

    experiment: Experiment
    weights: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    title: ClassVar[str]
    sides: ClassVar[frozenset[Side]]
    base_groups: ClassVar[frozenset[str]]
    predicts_force: ClassVar[bool] = False
    is_simulated: ClassVar[bool] = True

    @property
    def name(self) -> str:
        """Recording and view, for people."""
        return f"{self.experiment.recording.name}: {type(self).__name__.lower()}"

    @property
    def subsystem_channels(self) -> tuple[str, ...]:
        """The channels that belong to the subsystem, recorded or not."""
        return self.experiment.channels

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """The channels whose residuals the view holds; one without any noise has no measure for them."""
        e = self.experiment
        return tuple(c for c in e.channels if c in self.subsystem_channels and (c not in e.noise or e.noise[c].rms))

    def is_sensitive_to(self, effect: Effect) -> bool:
        """Whether the effect can show in this view."""
        return self.experiment.can_show(effect) and bool(self.sides & effect.balances)

    def exclusive_channels(self, effect: Effect) -> tuple[str, ...]:
        """Return the channels in which nothing shows but effects such as this one, at the same port."""
        return ()

    def is_sensitive_to_base(self, name: str) -> bool:
        """Whether a base parameter matters in this view."""
        return name.partition(".")[0] in self.base_groups

    @abstractmethod
    def residual(self, model: Model, errors: Mapping[str, Array] | None = None) -> dict[str, Array]:
        """Return measured minus model by channel, each (n,), SI; 0 where nothing was measured.

        ``errors`` of the starts are what :meth:`initial_state_sensitivity` gives, by default for this very model.
        """

    def initial_state_sensitivity(self, model: Model) -> dict[str, Array]:
        """Return what errors of the starts become (k, n), in units of noise; nothing where it has no such starts."""
        return {}

    def flow_gain_sensitivity(self, model: Model) -> dict[str, Array]:
        """Return what relative errors of the flow become, in units of noise; nothing where the view has no flow."""
        return {}

    def discrepancy_terms(self, model: Model, channel: str) -> Sequence[DiscrepancyTerm]:
        """Return as what something that a model lacks may act in a channel."""
        one = np.ones(self.experiment.time.size)
        return (DiscrepancyTerm("error", SIGNALS[channel].unit, one, lambda added: added / self.noise[channel]),)

    def apply_whitening(self, residual: Mapping[str, Array], errors: Mapping[str, Array]) -> dict[str, Array]:
        """Return residuals whitened for such errors."""
        return dict(residual)

    def log_determinant(self, errors: Mapping[str, Array]) -> Array:
        """Return what a likelihood adds to the squares of the residuals for such errors, channel after channel (N,)."""
        return np.zeros(self.experiment.time.size * len(self.channels))

    @cached_property
    def noise(self) -> dict[str, float]:
        """The standard deviation of each channel that the sensors alone would give."""
        e = self.experiment
        return {c: e.noise[c].rms for c in self.channels if c in e.noise}

    def monte_carlo_rms(self, model: Model, errors: Mapping[str, Array], draws: int, seed: int) -> dict[str, float]:
        """Return the rms by channel of drawn noise sent through the model, in units of the sensors' noise."""
        drawn = sample_deviations(model, self.experiment, draws)
        settled = [self.apply_whitening({c: d[i] for c, d in drawn.items()}, errors) for i in range(draws)]
        power = {c: float(np.mean([np.mean(s[c] ** 2) for s in settled])) for c in self.channels}
        return {c: float(np.sqrt(p)) / self.noise[c] for c, p in power.items()}

    def differs(self, a: Model, b: Model) -> bool:
        """Whether two models that differ in one parameter differ in this view at all."""
        if a.valves != b.valves:
            return self.valve_differs(a, b)
        changed = {name for name in b.values if a.values.get(name) != b.values[name]}
        parts = {name.partition(".")[0] for name in changed}
        felt = any(effect.name in parts and self.is_sensitive_to(effect) for effect in b.effects)
        return felt or any(self.is_sensitive_to_base(name) for name in changed)

    def valve_differs(self, a: Model, b: Model) -> bool:
        """Whether two models' valves may differ where this recording opened them."""
        if self.pressures_are_inputs:
            return False
        pairs = (
            [(a.chamber_2_valve, b.chamber_2_valve)] if self.experiment.recording.chamber == 2 else [(a.valve, b.valve)]
        )
        if len(self.opening_ranges) == 2:
            pairs.append((a.chamber_2_valve, b.chamber_2_valve))
        return any(
            low < most and high > least
            for (old, new), (least, most) in zip(pairs, self.opening_ranges, strict=True)
            for low, high in old.changed_ranges(new)  # type: ignore[arg-type]
        )

    @property
    def pressures_are_inputs(self) -> bool:
        """Whether measured pressures take the place of the valve."""
        return "valve" not in self.base_groups

    @cached_property
    def opening_ranges(self) -> list[tuple[float, float]]:
        """Between which openings (V) each path may have been: from rest to its largest ones."""
        e = self.experiment
        chambers: list[Chamber] = [e.recording.chamber] if e.vessel else [1, 2]
        opened = [u for u in (opening_from_null(e, chamber) for chamber in chambers) if u is not None]
        return [(min(float(u.min()), 0.0), max(float(u.max()), 0.0)) for u in opened]

    @cached_property
    def measured(self) -> dict[str, Array]:
        """What was measured by channel, each (n,), NaN where it was not."""
        return {c: self.experiment.measured(c) for c in self.channels}


def force_discrepancy_terms(experiment: Experiment, noise: float) -> tuple[DiscrepancyTerm, ...]:
    """Return as what a force, whose ``noise`` is in N, may act on the piston: 1 N of it, or 1 N s/m."""
    v = experiment.inputs[:, at.IN_V]
    each = (("force", "N", np.ones(v.size)), ("dry friction", "N", np.sign(v)), ("viscous friction", "N s/m", v))
    return tuple(DiscrepancyTerm(name, unit, one, lambda added: added / noise) for name, unit, one in each)


def bounded_difference(measured: Array, modelled: Array, noise: float) -> Array:
    """Return measured minus model (n,), 0 where nothing was measured; of a model that runs away, very much."""
    with np.errstate(invalid="ignore", over="ignore"):
        apart = measured - modelled
    apart[np.isnan(measured)] = 0.0
    return np.clip(
        np.nan_to_num(apart, copy=False, nan=MAX_RESIDUAL * noise), -MAX_RESIDUAL * noise, MAX_RESIDUAL * noise
    )
