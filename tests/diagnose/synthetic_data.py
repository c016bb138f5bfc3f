"""A bench of made-up effects: what each set of them leaves over is stated, block by block."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.evidence import score_gain
from pneucli.diagnose.score import FittedModel

TRAIN, TEST, SAMPLES = 40, 20, 250  # blocks, and residuals in each
Takes = Callable[[frozenset[str]], float]


def effect(name: str, *, parameters: int = 1, part: str = "cylinder", side: int | None = None, **more: Any) -> Any:
    """An effect whose parameters have no unit and a null of zero."""
    known = [
        SimpleNamespace(name=f"p{k}", unit="1", null=0.0, lower=-9.0, upper=9.0, **more) for k in range(parameters)
    ]
    made = SimpleNamespace(name=name, parameters=tuple(known), part=part, is_set_valued=False, ports={})
    made.side = side
    made.main_parameters, made.in_model_with = made.parameters, lambda effects: made
    return made


class SyntheticData:
    """Stands in for :class:`pneucli.diagnose.data.DiagnosisData`.

    ``takes`` says what a set of effects takes of the cost, as a share of what noise leaves, in the fitted and in the
    held-out blocks; every fit scatters a little. ``chance`` gives an effect's p value where it is not that of the gain.
    """

    def __init__(
        self, effects: Sequence[Any], takes: Takes, *, unseen: Takes | None = None, excess: float = 1.0, **more: Any
    ) -> None:
        self.effects = {e.name: e for e in effects}
        self.takes, self.unseen, self.excess = takes, unseen or takes, excess
        self.hypothesis_count = more.get("hypotheses", 50)
        self.base_effects: tuple[str, ...] = more.get("given", ())
        self.chance: dict[str, float] = more.get("chance", {})
        self.worse: set[str] = more.get("worse", set())
        self.sized_by: dict[str, set[str]] = more.get("sized_by", {})  # what an effect needs to have a size at all
        self.polished_names: list[str] = []
        self.added_names: list[tuple[str, ...]] = []
        residual_model = SimpleNamespace(experiment=SimpleNamespace(recording=SimpleNamespace(period=1e-3)))
        self.train, self.held_out = [residual_model], [residual_model] if more.get("held_out", True) else []
        self.has_held_out_data = bool(self.held_out)
        self.free_run_errors = None

    def model_with(self, names: Sequence[str]) -> FittedModel:
        chosen = frozenset(names)
        rng = np.random.default_rng(sum(map(hash_of, chosen)))
        train = SAMPLES * (1.0 + self.excess - self.takes(chosen)) + rng.normal(scale=1.0, size=TRAIN)
        test = SAMPLES * (1.0 + self.excess - self.unseen(chosen)) + rng.normal(scale=1.0, size=TEST)
        values = {f"{n}.{p.name}": 1.0 for n in names for p in self.effects[n].parameters}
        model = SimpleNamespace(effects=tuple(self.effects[n] for n in names), values=values)
        estimates = [SimpleNamespace(name=n, value=1.0, at_bound=False) for n in values]
        fit: Any = SimpleNamespace(
            model=model,
            estimates=estimates,
            free=(),
            residual=np.ones(TRAIN * SAMPLES),
        )
        if not self.held_out:
            return FittedModel(fit, train, np.zeros(0), train, np.full(TRAIN, SAMPLES))
        return FittedModel(fit, train, test, np.concatenate([train, test]), np.full(TRAIN + TEST, SAMPLES))

    def ranked_signatures(self, model_fit: FittedModel) -> list[Any]:
        promised = [
            (
                e,
                self.takes(frozenset([*model_fit.effect_names, e.name]))
                - self.takes(frozenset(model_fit.effect_names)),
            )
            for e in self.effects.values()
        ]
        found = [
            (e, [SimpleNamespace(gain=SAMPLES * TRAIN * max(p, 0.0) + 20.0)])
            for e, p in promised
            if e.name not in model_fit.effect_names and self.has_initial_guess(model_fit, e)
        ]
        return sorted(found, key=lambda pair: -pair[1][0].gain)

    def sensitive_cost(self, model_fit: FittedModel, one: Any) -> tuple[float, int]:
        return float(model_fit.train_costs.sum()), TRAIN * SAMPLES

    def sensitive_blocks(self, one: Any) -> np.ndarray:
        return np.ones(TRAIN + TEST, dtype=bool)

    def recording_costs(self, model_fit: FittedModel, one: Any) -> list[tuple[float, float]]:
        return [
            (float(model_fit.train_costs.sum()), TRAIN * SAMPLES),
            (float(model_fit.test_costs.sum()), model_fit.test_costs.size * SAMPLES),
        ]

    def exclusive_channel_costs(self, model_fit: FittedModel, one: Any) -> list[tuple[float, float]]:
        return []

    def refit_with(self, model_fit: FittedModel, effects: Sequence[Any], ranked: Any = ()) -> list[Candidate]:
        assert all(self.has_initial_guess(model_fit, one) for one in effects)
        self.added_names += [(*model_fit.effect_names, one.name) for one in effects]
        return [self.candidate(model_fit, self.model_with([*model_fit.effect_names, one.name]), one) for one in effects]

    def refit_to_convergence(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        self.polished_names += [t.effect.name for t in candidates]
        return list(candidates)

    def refit_without(self, model_fit: FittedModel, effects: Sequence[Any]) -> list[FittedModel]:
        return [self.model_with([n for n in model_fit.effect_names if n != one.name]) for one in effects]

    def candidate(self, before: FittedModel, after: FittedModel, one: Any) -> Candidate:
        train = score_gain(before.train_costs, after.train_costs)
        return Candidate(
            one,
            before,
            after,
            train,
            score_gain(before.test_costs, after.test_costs),
            self.chance.get(one.name, train.p_value),
        )

    def absent_effects(self, model: Any) -> list[Any]:
        return [e for e in self.effects.values() if e not in model.effects]

    def has_initial_guess(self, model_fit: FittedModel, one: Any) -> bool:
        return self.sized_by.get(one.name, set()) <= set(model_fit.effect_names)

    def free_run_error_rises(self, before: FittedModel, after: FittedModel) -> bool:
        return bool(self.worse & (set(after.effect_names) - set(before.effect_names)))

    def free_run_error_falls_clearly(self, before: FittedModel, after: FittedModel) -> bool:
        return not self.free_run_error_rises(before, after)


def hash_of(name: str) -> int:
    return sum(ord(c) * 31**k for k, c in enumerate(name)) % 10**6


def adding(**shares: float) -> Takes:
    """Each effect takes its own share, whatever else is there."""
    return lambda names: sum(shares.get(n, 0.0) for n in names)
