"""Whether a manoeuvre keeps the limits of a rig in every rival, parameters off by their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pneucli.identify.estimation.fit import Fit
from pneucli.plan.limits import Limits, violations
from pneucli.plan.manoeuvre import Manoeuvre
from pneucli.plan.rivals import Rival
from pneucli.plan.selection import Refused
from pneucli.plan.shifted import shifted_models
from pneucli.plan.simulation import simulate_manoeuvre
from pneucli.recording import Rig
from pneucli.simulate.model import Model

SHIFTED_BEST = 4  # draws of the best model's parameters
SHIFTED_RIVAL = 1  # draws of each rival's
SEED = 49


@dataclass
class Safety:
    """The models in which every chosen manoeuvre is simulated, and the manoeuvres that were refused.

    Attributes:
        rig: The rig.
        limits: Its limits.
        models: Models by name: the rivals, and each with parameters off by their intervals.
        refused: The refused manoeuvres.
    """

    rig: Rig
    limits: Limits
    models: Mapping[str, Model]
    refused: list[Refused] = field(default_factory=list)
    _known: dict[int, bool] = field(default_factory=dict)

    def __call__(self, manoeuvre: Manoeuvre) -> bool:
        """Return whether a manoeuvre keeps all limits in every model; a refusal is noted."""
        key = hash((manoeuvre.kind, manoeuvre.profile, manoeuvre.pressure, manoeuvre.force, manoeuvre.bench.drive))
        key = hash(
            (key, manoeuvre.bench.experiment, manoeuvre.bench.template.chamber_2, manoeuvre.bench.template.chamber)
        )
        if key not in self._known:
            self._known[key] = self._keeps_limits(manoeuvre)
        return self._known[key]

    def _keeps_limits(self, manoeuvre: Manoeuvre) -> bool:
        limits = self.limits.with_reserve()
        for name, model in self.models.items():
            if found := violations(simulate_manoeuvre(manoeuvre, model), limits, self.rig):
                self.refused.append(Refused(manoeuvre, name, tuple(found)))
                return False
        return True


def models_to_check(best: Fit, rivals: Sequence[Rival]) -> dict[str, Model]:
    """Return the models in which a manoeuvre must keep the limits.

    Args:
        best: The fit of the best model, whose covariance says how far parameters may be off.
        rivals: The rivals, the best model first.

    Returns:
        Models by name.
    """
    models: dict[str, Model] = {}
    for number, rival in enumerate(rivals):
        models[rival.name] = rival.model
        count = SHIFTED_BEST if rival.effect is None else SHIFTED_RIVAL
        for k, shifted in enumerate(shifted_models(best, rival.model, count, SEED + number), 1):
            models[f"{rival.name}, parameters off by their intervals ({k})"] = shifted
    return models
