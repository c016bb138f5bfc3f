"""What was exported."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pneucli.figure import flat, optional
from pneucli.messages import StageAnswer, labelled
from pneucli.messages.formatting import format_plain


@dataclass(frozen=True)
class PrecisionCost:
    """By how much commands of single precision differ from those of double precision, in V.

    ``rms_v`` is that of 99 samples in 100, ``largest_v`` of one in which a decision falls one sample apart.
    """

    rms_v: float
    p99_v: float
    largest_v: float

    @property
    def text(self) -> str:
        """The difference in words."""
        within = f"of 99 samples in 100 the command is within {_volts(self.p99_v)} of float64"
        return f"{within}, rms {_volts(self.rms_v)}; at most {_volts(self.largest_v)} apart"


@dataclass(frozen=True)
class ExportedController:
    """The controller that was written: its law, period, and the hash that its files carry."""

    controller: str
    period_s: float
    hash: str
    precision: str
    difference_from_float64: PrecisionCost | None

    @property
    def lines(self) -> Iterator[str]:
        """The period of the controller, and what its precision costs."""
        period = format_plain(1e3 * self.period_s)
        yield from labelled("found", f"controller {self.controller}, one step every {period} ms")
        if self.difference_from_float64:
            yield from labelled("found", f"{self.precision}: {self.difference_from_float64.text}")


@dataclass(frozen=True)
class PlantAnswer:
    """What an importer finds in the FMU; ``binaries`` are platforms, none where no C compiler is installed."""

    fmi: str
    inputs: Sequence[str]
    outputs: Sequence[str]
    parameters: Mapping[str, Mapping[str, Any]]
    effects: Sequence[str]
    binaries: Sequence[str]
    max_step_s: float

    @property
    def lines(self) -> Iterator[str]:
        """The plant's effects and signals."""
        effects = f" with {', '.join(self.effects)}" if self.effects else ""
        signals = f"inputs {', '.join(self.inputs)}; outputs {', '.join(self.outputs)}"
        yield from labelled("found", f"plant{effects}: {signals}; {len(self.parameters)} parameters")
        if not self.binaries:
            text = "no C compiler was found: the FMU holds its sources only; build it with FMPy"
            yield from labelled("warning", text)


@dataclass(frozen=True)
class Answer(StageAnswer):
    """The controller and the plant, those that were asked for, and the names of the files."""

    exported: ExportedController | None = field(default=None, metadata=flat())
    plant: PlantAnswer | None = optional()
    files: Sequence[str] = ()

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the controller, the plant, and the files."""
        for one in (self.exported, self.plant):
            yield from one.lines if one else ()
        yield from labelled("wrote", ", ".join(self.files))


def _volts(value: float) -> str:
    return f"{format_plain(value, 2)} V" if value >= 0.1 else f"{format_plain(1e3 * value, 2)} mV"
