"""The answer of ``leak``: what leaks with its interval, the law, whether it passes, and what limits the answer."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from pneucli.figure import Figure, laid_out, optional
from pneucli.messages import each, labelled
from pneucli.messages.formatting import format_figure, format_percent, format_quantity

VERDICTS = {
    "pass": "passes",
    "fail": "leaks too much",
    "undecided": "cannot be decided: the limit is within the interval",
}
LAWS = {
    "laminar": "flows as through a long gap (laminar)",
    "orifice": "flows as through a hole (orifice)",
    "between": "flows between the laws of a long gap and of a hole",
    "cannot tell": "the course does not tell a gap from a hole",
}
LAYOUT = "value ci95 unit"  # of a leak in the JSON
STILL_WARM = 1.0  # K over the wall: from here it is worth being said


def with_interval(one: Figure) -> str:
    """Return a leak with its interval; losses of pressure in Pa/s, in which leaks are stated."""
    return f"{format_figure(replace(one, unit='1'))} Pa/s" if one.unit == "Pa/s" else format_figure(one)


@dataclass(frozen=True)
class Bound:
    """The limit as it was stated, the quantity that it bounds, and its size in that quantity's unit."""

    text: str
    quantity: str
    value: float
    unit: str


@dataclass(frozen=True)
class LeakTest:
    """A shut vessel, SI: its course, its leak at the first pressure, and whether that is within the limit."""

    recording: str
    signal: str
    rest: float | None
    shut: Sequence[float]
    fitted_from: float
    pressure: float
    pressure_end: float
    rate: Figure = field(metadata=laid_out(LAYOUT))
    flow: Figure | None = field(metadata=laid_out(LAYOUT))
    area: Figure | None = field(metadata=laid_out(LAYOUT))
    throughput: Figure | None = field(metadata=laid_out(LAYOUT))
    law: str
    laminar_share: float
    warmed: float
    settling: float
    temperature_measured: bool
    drift_half_width: float
    misfit: float
    time: Sequence[float]
    values: Sequence[float]
    model: Sequence[Sequence[float]]
    verdict: str | None = None
    seconds_to_decide: float | None = None

    @property
    def known(self) -> dict[str, Figure]:
        """The quantities that are known of the leak."""
        quantities = {"rate": self.rate, "flow": self.flow, "area": self.area}
        return {name: one for name, one in quantities.items() if one is not None}

    @property
    def course(self) -> str:
        """From when to when, and from where to where."""
        first, last = (format_quantity(time, "s") for time in self.shut)
        before = "" if self.rest is None else f"rests at {format_quantity(self.rest, 'Pa')}, then "
        begins, ends = (format_quantity(p, "Pa") for p in (self.pressure, self.pressure_end))
        return f"{before}is shut from {first} to {last} and comes from {begins} to {ends}"

    def sentence(self, limit: Bound | None) -> str:
        """Return the leak in all units, and whether it passes."""
        verdict = "" if limit is None or self.verdict is None else f"{VERDICTS[self.verdict]} ({limit.text}): "
        found = ", ".join(map(with_interval, self.known.values()))
        return f"{verdict}{found} at {format_quantity(self.pressure, 'Pa')}"

    def doubts(self, drift: float) -> Iterator[str]:
        """Yield what limits the answer, and what would help; ``drift`` is that of the wall in K."""
        low, high = self.rate.low, self.rate.high
        half = 0.5 * (high - low)
        if abs(self.warmed) > STILL_WARM:
            side = "warmer" if self.warmed > 0.0 else "colder"
            yield (
                f"the gas was about {format_quantity(abs(self.warmed), 'K', 2)} {side} than the wall at first and took "
                f"{format_quantity(self.settling, 's', 2)} to settle: wait longer before the test"
            )
        if not self.temperature_measured and half and (share := self.drift_half_width / half) > 0.5:
            yield (
                f"{format_percent(min(share, 1.0))} of the interval is what a drift of the wall by "
                f"{format_quantity(drift, 'K', 2)} could do: record it, test longer, or state --drift"
            )
        if low <= 0.0 <= high:
            yield "no leak is seen; the upper end of the interval is the most there can be"
        elif high < 0.0:
            yield "the pressure moves away from ambient: the vessel is being filled, or becomes warmer"
        if self.seconds_to_decide is not None:
            yield f"a test of about {format_quantity(self.seconds_to_decide, 's', 2)} would decide"


@dataclass(frozen=True)
class Answer:
    """The leaks of shut vessels, SI; ``drift`` is the standard uncertainty of the wall's change of temperature."""

    schema: str
    volume: float | None
    ambient_pressure: float
    temperature: float
    drift: float
    limit: Bound | None
    tests: Sequence[LeakTest]
    left_out: Sequence[str]
    verdict: str | None
    page: str | None = optional()

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield each test: verdict, rates, course and doubts; then what was left out."""
        for one in self.tests:
            yield from labelled("leak", f"{one.recording}: {one.sentence(self.limit)}")
            yield from labelled("", f"it {one.course}; {LAWS[one.law]}")
            yield from each("doubt", one.doubts(self.drift))
        yield from each("left out", self.left_out)
        if self.volume is None:
            yield from labelled("do", f'pneucli leak {file} --volume "2 l", from which flow and area follow')
