"""A valve on a steady bench: its characteristics, and what its rows say that a valve does not explain."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pneucli.figure import Figure, laid_out
from pneucli.messages import labelled, table
from pneucli.messages.formatting import format_figure, format_noise_ratio, format_number

FLOW_COLUMNS = ("command", "rows", "C (ISO 6358)", "b", "m", "cracking pressure", "× noise")
LAYOUT = "value unit ci95 determined"  # of a characteristic; typical values of valves hold what is not determined
LITRES_PER_BAR = 1e8  # l/(s bar) in m^3/(s Pa)


def format_conductance(one: Figure) -> str:
    """Return a sonic conductance in l/(s bar) with its interval."""
    low, high = LITRES_PER_BAR * one.low, LITRES_PER_BAR * one.high
    return format_figure(Figure(LITRES_PER_BAR * one.value, low, high, "l/(s bar)"))


@dataclass(frozen=True)
class FlowResidual:
    """The rms residual of a path in ``unit``, and over the scatter of neighbouring rows."""

    rms: float
    unit: str
    ratio_to_noise: float


@dataclass(frozen=True)
class FlowPath:
    """One opening: its command, its number of rows and their range of pressure ratios, and its characteristics, SI."""

    name: str
    u: float | None
    direction: str
    rows: int
    C: Figure = field(metadata=laid_out(LAYOUT))
    b: Figure = field(metadata=laid_out(LAYOUT))
    m: Figure = field(metadata=laid_out(LAYOUT))
    cracking_pressure: Figure | None = field(metadata=laid_out(LAYOUT))
    opens_abruptly: bool
    pressure_ratio: Sequence[float]
    residual: FlowResidual

    @property
    def row(self) -> tuple[str, ...]:
        """Command, number of rows, C, b, m, cracking pressure, and residual over noise."""
        b, m = (format_figure(one) + ("" if one.determined else " *") for one in (self.b, self.m))
        opens = "–" if self.cracking_pressure is None else format_figure(self.cracking_pressure)
        ratio = format_noise_ratio(self.residual.ratio_to_noise)
        return self.name or "one opening", f"{self.rows}", format_conductance(self.C), b, m, opens, ratio


@dataclass(frozen=True)
class FlowFinding:
    """What the rows say that a valve does not explain."""

    code: str
    text: str


@dataclass(frozen=True)
class Flow:
    """A steady bench: its flow paths and their parameters, what its rows say, and their noise."""

    paths: Sequence[FlowPath]
    parameters: Mapping[str, Figure]
    command_sets_area: bool | None
    findings: Sequence[FlowFinding]
    noise: Mapping[str, Any]

    @property
    def lines(self) -> Iterator[str]:
        """The table of the bench; an asterisk marks what typical values hold."""
        several = "s" if len(self.paths) > 1 else ""
        yield from labelled("flow", f"{len(self.paths)} flow path{several} of a steady bench")
        yield from table(FLOW_COLUMNS, [path.row for path in self.paths], texts=6)
        if not all(path.b.determined and path.m.determined for path in self.paths):
            text = "the rows do not determine b or m there: typical values of valves (b 0.35, m 0.5) hold them"
            yield from labelled("*", text)


def flow_verdict(base: float | None, last: float | None, named: str, left: str, beyond: str = "") -> str:
    """Return the verdict of a diagnosis of a steady bench in a sentence.

    Args:
        base: Error of the given model over noise.
        last: Error of the model with what was named.
        named: The effect that is named with its value; empty where none is.
        left: What the rows say that no effect of the catalogue explains; empty where nothing is left.
        beyond: What C, b and m of each opening describe and an effect does not; empty where that is nothing.

    """
    errors = [format_noise_ratio(one) for one in (base, last)]
    parts = (
        [f"The model lacks {named}: the error goes from {errors[0]} to {errors[1]} times the noise."] if named else []
    )
    if left:
        parts.append(f"No effect of the catalogue explains what remains: {left}.")
    elif beyond:
        parts.append(f"{beyond}.")
    elif not named:
        parts.append(f"Nothing in the rows exceeds their scatter (error {errors[1]} times the noise).")
    return " ".join(parts)


def other_shape(ratio: float | None) -> str:
    """Return that the equation of ISO 6358 leaves more than the scatter of the rows."""
    return f"C, b and m of each opening leave {format_noise_ratio(ratio)} times the scatter of neighbouring rows"


def other_characteristics(m: tuple[float, float, float], ratio: float | None) -> str:
    """Return what C, b and m of each command achieve where one b for all commands does not suffice."""
    low, high = (format_number(one, 3) for one in (m[1], m[2]))
    return (
        f"What remains is described by C, b and m of each opening, which identify gives (m {low} to {high} where the "
        f"simulation has 0.5): they leave {format_noise_ratio(ratio)} times the noise"
    )


def undetermined_sentence() -> str:
    """Return why no statement is possible about rows that are choked throughout."""
    return (
        "No statement is possible: the rows do not determine the critical ratio, and none has the valve closed, so "
        "neither another flow function nor a leak could show."
    )


def next_rows(*, ratio: bool, closed: bool) -> str | None:
    """Return which rows to record next; None where none is missing."""
    wanted = ["five and more downstream pressures between 0.3 and 0.98 of the upstream one at each command"] * ratio
    wanted += ["a row with the valve closed"] * closed
    return f"record {' and '.join(wanted)}" if wanted else None


def effect_reason(title: str, *, named: bool, before: float | None, after: float | None) -> str:
    """Return why an effect that was fitted to rows of steady flow is named or not."""
    if not named:
        return f"{title}. The improvement is no larger than chance."
    errors = [format_noise_ratio(one) for one in (before, after)]
    return f"{title}: with it the error goes from {errors[0]} to {errors[1]} times the noise."
