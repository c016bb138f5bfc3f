"""Candidates and data of a diagnosis made by hand, without recordings of a rig."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from pneucli.diagnose.candidate import Candidate
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.score import ChannelCost, ErrorsByUse, FittedModel
from pneucli.physics.effects import catalogue
from tests.simulate.synthetic_experiments import model

BLOCKS, SAMPLES = 40, 4000
COUNTS = np.full(BLOCKS, SAMPLES / BLOCKS)
VIEW: Any = SimpleNamespace(
    experiment=SimpleNamespace(
        recording=SimpleNamespace(period=1e-3, name="one"), time=np.arange(SAMPLES) * 0.25 * BLOCKS / SAMPLES
    ),
    channels=("force",),
    predicts_force=False,
    is_sensitive_to=lambda effect: True,
    exclusive_channels=lambda effect: (),
)


@dataclass(frozen=True)
class StatedErrors:
    """Free-run errors of models as they are stated; correct models err by less than ``limit``."""

    of: Callable[[Any, Any], ErrorsByUse]
    limit: float | None = None

    def __call__(self, model: Any, reference: Any = None) -> ErrorsByUse:
        return self.of(model, reference)

    def limits(self, model: Any) -> ErrorsByUse:
        return {"train": self.limit, "test": self.limit}


def costing(fitted: Any, costs: np.ndarray, counts: np.ndarray = COUNTS) -> FittedModel:
    """A fitted model with these costs by block, of one channel."""
    channel = ChannelCost(float(costs.sum()), float(counts.sum()))
    return FittedModel(fitted, costs, np.zeros(0), costs, counts, (channel,))


def model_fit(names: Sequence[str] = (), cost: float = 8000.0) -> FittedModel:
    """A fit with effects that costs the same in every block."""
    fitted: Any = SimpleNamespace(
        model=model(names),
        estimates=(),
        free=(),
        residual=np.ones(SAMPLES),
        blocks=np.arange(SAMPLES) * BLOCKS // SAMPLES,
    )
    costs = np.full(BLOCKS, cost / BLOCKS)
    return costing(fitted, costs)


def shaky(before: FittedModel, fall: float, scatter: float, names: Sequence[str] = ()) -> FittedModel:
    """A fitted model that costs less in all, where some blocks cost less and others more."""
    turns = np.where(np.arange(BLOCKS) % 2, scatter, -scatter)
    costs = before.costs - fall / BLOCKS - turns
    return costing(model_fit(names).fit, costs)


def candidate(
    effect: str,
    cost: float = 4000.0,
    *,
    before: FittedModel | None = None,
    ends: Mapping[str, tuple[float, bool]] | None = None,
    p_value: float = 1e-9,
    beside: Sequence[str] = (),
) -> Candidate:
    """The step to a model with one effect more; ``ends`` has value and whether at a bound by parameter, ``beside`` the
    effects of both models.
    """
    before = before or model_fit()
    after = model_fit([effect], cost)
    ended = ends or {p.name: (1e-3, False) for p in catalogue()[effect].parameters}
    values = {f"{effect}.{name}": value for name, (value, _) in ended.items()}
    fitted: Any = SimpleNamespace(
        model=model([*beside, effect], values),
        estimates=tuple(
            SimpleNamespace(name=f"{effect}.{name}", value=value, at_bound=at_bound)
            for name, (value, at_bound) in ended.items()
        ),
        free=tuple(
            SimpleNamespace(
                name=f"{effect}.{name}",
                upper=value if at_bound else 1e9,
                lower=value if at_bound else -1e9,
                step=1e-4,
                scale=1.0,
            )
            for name, (value, at_bound) in ended.items()
        ),
        covariance=np.eye(len(ended)),
    )
    return Candidate(catalogue()[effect], before, costing(fitted, after.costs), p_value)


def diagnosis_data(
    errors: Sequence[tuple[FittedModel, float, float | None]] = (), *, held_out: bool = True, **changes: Any
) -> DiagnosisData:
    """The data of a diagnosis with one residual model; ``errors`` are the free-run errors of fitted models by use."""
    seen = {id(s.model): {"train": train, "test": test} for s, train, test in errors}
    shown = StatedErrors(lambda model, _: seen[id(model)]) if errors else None
    made = DiagnosisData([VIEW], [VIEW] if held_out else [], catalogue(), free_run_errors=shown, **changes)
    made.__dict__["hypothesis_count"] = 50
    return made
