"""What changed since an earlier diagnosis: each parameter with its interval, or the sizes that would have been seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pneucli.figure import Figure, flat
from pneucli.messages.design import Quantity
from pneucli.messages.formatting import format_figure, format_number, format_quantity, join_names


@dataclass(frozen=True)
class Change:
    """One change since an earlier diagnosis, by the name of its parameter; ``effect`` where it belongs to one.

    An end of ``after`` is not finite where the search ended there. ``confidence`` is one minus the
    probability that a healthy repeat looks as changed in any quantity, ``confidence_alone`` that of this change among
    those that it is ``indistinguishable_from``, which explain the change equally well.
    """

    name: str
    effect: str | None
    before: float | None
    after: Figure = field(metadata=flat("after:value unit ci95"))
    confidence: float
    confidence_alone: float
    indistinguishable_from: Sequence[str] = ()

    @property
    def text(self) -> str:
        """The change with its interval, its false-alarm probability, and its equivalents."""
        before = "nothing" if self.before is None else format_quantity(self.before, self.after.unit, 3)
        after = format_figure(self.after)
        equivalents = f", or {join_names(self.indistinguishable_from)}" if self.indistinguishable_from else ""
        chance = format_number(max(1.0 - self.confidence, 1e-12), 1)
        return f"{self.name}{equivalents} changed from {before} to {after} (chance of a false alarm {chance})"


@dataclass(frozen=True)
class DetectableChange:
    """The minimum detectable change of a parameter; ``plausible``: it is within a typical size."""

    name: str
    size: float
    unit: str
    plausible: bool


@dataclass(frozen=True)
class Repeatability:
    """The standard deviation of each parameter between the ``dates`` of a healthy rig."""

    dates: int
    parameters: Mapping[str, Quantity]


@dataclass(frozen=True)
class Since:
    """The comparison with the baseline of an earlier diagnosis."""

    folder: str
    alarm_rate: float
    p_value: float
    unseen: Sequence[DetectableChange]
    sha256: str
    repeat: Mapping[str, Sequence[float]]
    repeatability: Repeatability | None


def changes_since_baseline(changes: Sequence[Change], since: Since) -> str:
    """Return the changes since the baseline, or the sizes from which a change is detectable."""
    if changes:
        return "; ".join(one.text for one in changes)
    unseen = [one for one in since.unseen if one.plausible]
    sizes = [f"{one.name} by {format_quantity(one.size, one.unit, 2)}" for one in unseen[:3]]
    text = f"no change detected in {len(since.unseen)} parameters and effects"
    text += f"; a change from these sizes on would have been named: {join_names(sizes)}" if sizes else ""
    unknown = "; the variation from date to date without a change is unknown (--repeat)"
    return text if since.repeatability else text + unknown
