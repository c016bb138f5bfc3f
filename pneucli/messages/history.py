"""How the error fell from the first model to the one as it is."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from pneucli.figure import Figure
from pneucli.messages import diagnose, labelled, table
from pneucli.messages.compare import Errors, evaluation_error
from pneucli.messages.formatting import format_noise_ratio, format_quantity, join_names

MODEL_TITLES = ("when (UTC)", "effects", "test", "train")
BAR_LENGTH = 24  # characters of the longest bar


@dataclass(frozen=True)
class Model:
    """A model that was compared: its errors over noise, digest of the data, when, whether present, and its number."""

    effects: Sequence[str]
    error: Errors
    data: str
    when: str
    current: bool
    parameters: Mapping[str, Figure]
    number: int = 0

    def added(self, effects: Sequence[str]) -> Mapping[str, Figure]:
        """Return the parameters of these effects; those of a single one without its name."""
        found = {name: p for name, p in self.parameters.items() if name.partition(".")[0] in effects}
        return {name.partition(".")[2]: p for name, p in found.items()} if len(effects) == 1 else found

    @property
    def date(self) -> str:
        """Day and time, UTC."""
        return self.when.replace("T", " ").removesuffix("Z")

    @property
    def row(self) -> tuple[str, ...]:
        """The row of a table under ``MODEL_TITLES``."""
        errors = (format_noise_ratio(self.error[use]) for use in ("test", "train"))
        return self.date, ", ".join(self.effects) or "base model", *errors


@dataclass(frozen=True)
class PathStep:
    """A model on the way: what it changes of the one before, its errors over noise, and whether it is only suggested.

    ``present``: it is the model as it is.
    """

    label: str
    error: Errors
    present: bool = False
    suggested: bool = False


def path_steps(models: Sequence[Model], diagnosis: diagnose.Answer) -> list[PathStep]:
    """Return models on the same data, oldest first, and what the last diagnosis would add to the last of them."""
    first = models[0].effects if models else diagnosis.model.effects
    labels = [f"base model{f' with {join_names(first)}' if first else ''}"]
    for before, after in pairwise(models):
        added = [f"+ {n}" for n in after.effects if n not in before.effects]
        removed = [f"− {n}" for n in before.effects if n not in after.effects]
        labels.append(" ".join([*added, *removed]) or "fitted again")
    errors = [one.error for one in models] or [one.error for one in diagnosis.ladder[:1]]
    steps = [PathStep(*step, present=n == len(errors)) for n, step in enumerate(zip(labels, errors, strict=True), 1)]
    named = [step for step in diagnosis.ladder if step.add in diagnosis.missing]
    return [*steps, *(PathStep(f"+ {step.add}", step.error, suggested=True) for step in named)]


def lines(models: Sequence[Model], file: str, verbose: bool = False) -> Iterator[str]:
    """Yield the fall in one line, then every model, oldest first; models on other data in tables of their own.

    With ``verbose`` the parameters of each model on the present data follow.
    """
    if not models:
        yield from labelled("found", f"no model was compared yet: pneucli compare {file}")
        return
    here = models_on_current_data(models)
    yield from labelled("error", error_reduction(here))
    yield from _table(here)
    if verbose:
        yield from _parameters(here)
    for data in dict.fromkeys(m.data for m in models if m.data != here[-1].data):
        yield ""
        yield "on other recordings, or at another horizon; not to be compared with the above:"
        yield from _table([m for m in models if m.data == data])


def _parameters(models: Sequence[Model]) -> Iterator[str]:
    names = list(dict.fromkeys(name for model in models for name in model.parameters))
    if names:
        yield ""
        head = ["parameter", *(model.date for model in models)]
        yield from table(head, [[name, *(_value(model.parameters.get(name)) for model in models)] for name in names], 1)


def _value(found: Figure | None) -> str:
    return "-" if found is None else format_quantity(found.value, found.unit)


def models_on_current_data(models: Sequence[Model]) -> list[Model]:
    """Return the models on the data of the model as it is, oldest first, that one last."""
    now = next((m for m in models if m.current), models[-1])
    return [*(m for m in models if m.data == now.data and m is not now), now]


def error_reduction(models: Sequence[Model]) -> str:
    """Return first and last error of models on the same data, and what was changed between them."""
    first, last = models[0], models[-1]
    use, after = evaluation_error(last.error)
    text = (
        f"{format_noise_ratio(first.error[use])} → {format_noise_ratio(after)} × noise"
        if len(models) > 1
        else f"{format_noise_ratio(after)} × noise"
    )
    changes = effect_changes(first, last)
    return f"{text} on {use} recordings{f' with {changes}' if changes else ''}"


def effect_changes(first: Model, last: Model) -> str:
    """Return the effects that were added and removed between two models."""
    added, removed = ([n for n in b.effects if n not in a.effects] for a, b in ((first, last), (last, first)))
    return " ".join(filter(None, [join_names(added), f"without {join_names(removed)}" if removed else ""]))


def _table(models: Sequence[Model]) -> Iterator[str]:
    use, _ = evaluation_error(models[-1].error)
    most = max(m.error[use] or 0.0 for m in models)
    width = BAR_LENGTH + 4
    bars = (error_bar(m.error[use], most) + " now" * m.current for m in models)
    rows = [(*m.row, bar.ljust(width)) for m, bar in zip(models, bars, strict=True)]
    yield from table((*MODEL_TITLES, "error down to 1".ljust(width)), rows, texts=2)


def error_bar(error: float | None, largest: float) -> str:
    """Return a bar that is as long as the logarithm of the error; none at 1, the noise floor."""
    share = bar_share(error, largest)
    return "#" * max(1, round(BAR_LENGTH * share)) if share > 0.0 else ""


def bar_share(error: float | None, largest: float) -> float:
    """Return the length of a bar down to 1, the noise floor, as a share of the longest, on a logarithmic scale.

    >>> bar_share(10.0, 100.0), bar_share(0.9, 100.0)
    (0.5, 0.0)
    """
    return 0.0 if error is None or error <= 1.0 or largest <= 1.0 else math.log(error) / math.log(largest)
