"""``diff``: two finished runs side by side: effects, errors, parameters beyond their intervals, verdicts."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pneucli.errors import InputError
from pneucli.figure import Figure, laid_out, read
from pneucli.messages import compare, diagnose, labelled, table
from pneucli.messages.compare import ChannelResult, evaluation_error
from pneucli.messages.formatting import (
    format_figure,
    format_noise_ratio,
    format_number,
    format_plain,
    format_quantity,
    join_names,
)
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.manifest import Manifest

Ends = Sequence[float | None]
CHANCE = 0.05  # of a 95 % interval to miss
MIN_ERROR_CHANGE = 0.005  # of an error: what its three digits show


@dataclass(frozen=True)
class RunAnswers:
    """What a run found: the answer of ``compare``, and that of ``diagnose`` if it diagnosed the same model and data."""

    path: str
    compare: compare.Answer
    diagnose: diagnose.Answer | None


@dataclass(frozen=True)
class Side:
    """One of the two runs; the last three of a diagnosis are None where the present model was not diagnosed."""

    path: str
    pipeline: str
    effects: Sequence[str]
    error: Mapping[str, float | None]
    data: str
    verdict: str | None
    missing: Sequence[str] | None
    sentence: str | None

    @property
    def told(self) -> str:
        """The verdict in words."""
        if self.verdict is None:
            return "not diagnosed, or not as the model is now"
        return f"{self.verdict}. {self.sentence}"


@dataclass(frozen=True)
class ParameterChange:
    """A parameter of both runs, or of one.

    ``ci95`` is that of the ``difference``, ``distance`` the difference over the half width of its interval toward zero:
    ``beyond`` 1 it excludes zero.
    """

    name: str
    unit: str
    a: Figure | None = field(metadata=laid_out("value ci95"))
    b: Figure | None = field(metadata=laid_out("value ci95"))
    difference: float | None = None
    ci95: Ends | None = None
    distance: float | None = None
    beyond: bool | None = None

    @property
    def row(self) -> tuple[str, ...]:
        """The row of the table."""
        a, b = ("-" if one is None else format_figure(one) for one in (self.a, self.b))
        change = "-" if self.difference is None else format_quantity(self.difference, self.unit, 3)
        return self.name, a, b, change, "-" if self.distance is None else format_number(self.distance, 2)


@dataclass(frozen=True)
class ErrorChange:
    """The error of a recording over noise in two answers of ``compare``; None where one does not have it."""

    recording: str
    use: str
    before: float | None
    after: float | None

    @property
    def is_visible(self) -> bool:
        """Whether three digits show the change."""
        a, b = self.before, self.after
        if a is None or b is None:
            return (a is None) != (b is None)
        return abs(b - a) > MIN_ERROR_CHANGE * max(a, b)

    @property
    def row(self) -> tuple[str, ...]:
        """The row of a table."""
        return self.recording, self.use, format_noise_ratio(self.before), format_noise_ratio(self.after)


@dataclass(frozen=True)
class Difference:
    """The answer of ``diff``: what b has that a has not, and where both differ."""

    schema: str
    a: Side
    b: Side
    same_data: bool
    effects: Mapping[str, Sequence[str]]
    parameters: Sequence[ParameterChange]
    recordings: Sequence[ErrorChange]

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield effects, errors, parameters beyond their intervals and verdicts of two runs."""
        sides = {"A": self.a, "B": self.b}
        for name, side in sides.items():
            yield from labelled(name, f"{side.path}: {join_names(side.effects) or 'base model'}")
        only = [f"only {name}: {join_names(self.effects[f'only_{name.lower()}'])}" for name in sides
                if self.effects[f"only_{name.lower()}"]]  # fmt: skip
        yield from labelled("effects", "; ".join(only) or "the same in both")
        yield from labelled("error", self._errors())
        yield from labelled("found", self._found())
        shown = [one.row for one in self.parameters if verbose or one.beyond]
        if shown:
            yield from table(("parameter", "A", "B", "B - A", "× interval"), shown, texts=1)
        for name, side in sides.items():
            yield from labelled("verdict", f"{name}: {side.told}")
        recordings = [one.row for one in self.recordings if verbose or one.is_visible]
        if recordings:
            yield from table(("recording", "use", "A", "B, × noise"), recordings, texts=2)

    def _errors(self) -> str:
        use, _ = evaluation_error(self.b.error)
        a, b = (format_noise_ratio(side.error.get(use)) for side in (self.a, self.b))
        other = "" if self.same_data else "; on other recordings or at another horizon, so the errors do not compare"
        return f"{a} → {b} × noise on {use} recordings{other}"

    def _found(self) -> str:
        """Return how many parameters differ beyond their intervals, and how many would by chance."""
        compared = [one.beyond for one in self.parameters if one.beyond is not None]
        if not compared:
            return "no parameter has an interval in both"
        return (
            f"{sum(compared)} of {len(compared)} parameters differ by more than their 95 % intervals allow; in two "
            f"repeats of one rig about {format_plain(CHANCE * len(compared), 1)} would"
        )


def read_answers(path: str, folder: Path) -> RunAnswers:
    """Read the answers of a run from the folder of its artifacts; ``path`` is what the user calls it.

    Raises InputError where no model was compared there.
    """
    compared = staleness.read_manifest(folder / "compare")
    if compared is None or compared.answer is None:
        why = (compared.skipped or {}).get("found") if compared else None
        found = f"no model was compared there{(why and f': {why}') or ''}"
        raise InputError(
            path, found, "a pipeline file, or the artifacts of a compared pipeline", "pneucli compare FILE", code="E007"
        )
    diagnosed = staleness.read_manifest(folder / "diagnose")
    same = diagnosed is not None and diagnosed.answer is not None and _same_basis(folder, diagnosed, compared.answer)
    own = read(diagnose.Answer, diagnosed.answer) if same and diagnosed and diagnosed.answer else None
    return RunAnswers(path, read(compare.Answer, compared.answer), own)


def _same_basis(folder: Path, diagnosed: Manifest, compared: Mapping[str, Any]) -> bool:
    """Return whether a diagnosis belongs to the recordings and the effects of ``compare``."""
    parents = diagnosed.inputs.parents
    now = {name: manifest.inputs.key for name in parents if (manifest := staleness.read_manifest(folder / name))}
    effects = (diagnosed.answer or {}).get("model", {}).get("effects", compared["model"]["effects"])
    return now == dict(parents) and effects == compared["model"]["effects"]


def difference(a: RunAnswers, b: RunAnswers) -> Difference:
    """Return the answer of ``diff``."""
    was, now = a.compare.model, b.compare.model
    return Difference(
        schema="pneucli/diff/1",
        a=_side(a),
        b=_side(b),
        same_data=a.compare.data == b.compare.data,
        effects={
            "only_a": [name for name in was.effects if name not in now.effects],
            "only_b": [name for name in now.effects if name not in was.effects],
        },
        parameters=_parameters(was.parameters, now.parameters),
        recordings=error_changes(a.compare.channels, b.compare.channels),
    )


def _side(one: RunAnswers) -> Side:
    found, compared = one.diagnose, one.compare
    diagnosed = (None, None, None) if found is None else (found.verdict, found.missing, found.sentence)
    return Side(one.path, compared.pipeline, compared.model.effects, compared.error, compared.data, *diagnosed)


def _parameters(a: Mapping[str, Figure], b: Mapping[str, Figure]) -> list[ParameterChange]:
    """Return every parameter of either model; those beyond their intervals first, the most distant one first."""
    rows = [_parameter(name, a.get(name), b.get(name)) for name in dict.fromkeys([*a, *b])]
    return sorted(rows, key=lambda row: -row.distance if row.distance is not None else 0.0)


def _parameter(name: str, a: Figure | None, b: Figure | None) -> ParameterChange:
    units = [one.unit for one in (a, b) if one is not None]
    both = ParameterChange(name, units[0], a, b)
    if a is None or b is None or a.unit != b.unit:
        return both
    found = interval_difference(a, b)
    if found is None:
        return replace(both, difference=b.value - a.value)
    ends = [found.low, found.high]
    return replace(both, difference=found.value, ci95=ends, distance=_distance(found), beyond=found.excludes(0.0))


def _distance(change: Figure) -> float | None:
    """Return the difference over the half width of its interval toward zero: beyond 1 it excludes zero."""
    half = change.value - change.low if change.value > 0.0 else change.high - change.value
    return abs(change.value) / half if half > 0.0 else (0.0 if change.value == 0.0 else None)


def error_changes(before: Sequence[ChannelResult], after: Sequence[ChannelResult]) -> list[ErrorChange]:
    """Return the error of each recording over noise, in two answers of ``compare``; test recordings first.

    Args:
        before: ``channels`` of the first answer.
        after: ``channels`` of the second answer.

    """
    was, now = _errors_by_recording(before), _errors_by_recording(after)
    keys = sorted(dict.fromkeys([*now, *was]), key=lambda key: key[1])
    return [ErrorChange(*key, was.get(key), now.get(key)) for key in keys]


def _errors_by_recording(channels: Sequence[ChannelResult]) -> dict[tuple[str, str], float | None]:
    """Return the error of each recording over noise: the root mean square over its channels."""
    squares: dict[tuple[str, str], list[float]] = {}
    for c in channels:
        ratio = c.ratio_to_noise
        squares.setdefault((c.recording, c.use), []).extend([] if math.isnan(ratio) else [ratio**2])
    return {key: math.sqrt(sum(of) / len(of)) if of else None for key, of in squares.items()}


def interval_difference(a: Figure, b: Figure) -> Figure | None:
    """Return the difference b - a of two independent estimates with its 95 % interval.

    Each end of the interval follows from the ends that face each other, so intervals may be asymmetric. For symmetric
    ones the half width is the root of the sum of the squared half widths.

    Args:
        a: The first estimate.
        b: The second estimate, in the unit of the first.

    Returns:
        The difference; None where the interval of either one is open.

    References:
        G. Y. Zou and A. Donner, Statistics in Medicine 27 (2008) 1693-1702 (method of variance estimates recovery).

    >>> interval_difference(Figure(10.0, 7.0, 13.0, "N"), Figure(15.0, 11.0, 19.0, "N"))
    Figure(value=5.0, low=0.0, high=10.0, unit='N', determined=True)
    """
    difference = b.value - a.value
    low = difference - math.hypot(b.value - b.low, a.high - a.value)
    high = difference + math.hypot(b.high - b.value, a.value - a.low)
    return Figure(difference, low, high, a.unit) if math.isfinite(high - low) else None
