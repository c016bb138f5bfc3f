"""The answer of ``identify``: the parameters with their intervals, the valve, friction, leaks and their uncertainty."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pneucli.figure import Figure, flat, optional
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.compare import LeftOut, ModelAnswer
from pneucli.messages.flow import Flow, format_conductance
from pneucli.messages.formatting import (
    format_figure,
    format_interval,
    format_noise_ratio,
    format_number,
    format_percent,
    format_quantity,
    join_names,
    unit_symbol,
)

INTERVAL_MEANING = (
    "Intervals are the value ± the expanded uncertainty (k = 2, GUM) of all sources of the budget; where the thermal "
    "state of the gas is open, they hold for every state between no heat and the most that the wall can give or take."
)
ISO_COLUMNS = ("command", "C (ISO 6358)", "b", "m")
FRICTION_COLUMNS = ("recording", "p1", "kinetic friction", "break-away")
FLOW_UNIT = "l/min ANR"


@dataclass(frozen=True)
class Assumption:
    """What the program took for granted because the pipeline file does not say it; ``instead`` is what would say it."""

    what: str
    instead: str


@dataclass(frozen=True)
class ValveDeviation:
    """How far the model's valve is off measured gradients, as shares of them; ``share_outside`` of the points."""

    median: float | None
    p95: float | None
    share_outside: float | None

    @property
    def text(self) -> str:
        """The deviation in words."""
        what = "measured gradients"
        if self.median is None or self.p95 is None or self.share_outside is None:
            return f"its valve cannot be compared with {what}: none is known to 10 %"
        off = f"{format_percent(self.median)} in the median, {format_percent(self.p95)} at the 95th percentile"
        return f"its valve is off {what} by {off}, outside both intervals at {format_percent(self.share_outside)}"


@dataclass(frozen=True)
class MapResidual:
    """The residual of the model over the noise, on fitted curves and on held-out ones, and by recording."""

    train: float | None
    test: float | None
    recordings: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Valve:
    """The valve's paths at one chamber; ``map``: ``measured`` on a vessel, or ``model``, on a driven piston."""

    map: str
    volume: Mapping[str, Any] | None
    overlap: Mapping[str, Figure]
    iso: Mapping[str, Figure]
    lack_of_fit: ValveDeviation
    residual: MapResidual

    @property
    def text(self) -> str:
        """How well the model follows the curves and the measured gradients."""
        if self.map == "model":
            return f"no vessel was filled: the map is that of the model; {self.lack_of_fit.text}"
        ratios = ((self.residual.train, "the curves"), (self.residual.test, "held-out ones"))
        left = [f"{format_noise_ratio(ratio)} × noise on {where}" for ratio, where in ratios if ratio is not None]
        return f"the model leaves {', '.join(left) or 'no noise to compare with'}; {self.lack_of_fit.text}"

    def iso_rows(self, label: str) -> list[tuple[str, ...]]:
        """Return the characteristics of ISO 6358 by command: command, C, b, m."""
        rows: list[tuple[str, ...]] = []
        for name in [name for name in self.iso if name.startswith(f"{label}.sonic_conductance(")]:
            of = "(" + name.partition("(")[2]
            figures = ("sonic_conductance", "critical_ratio", "subsonic_index")
            c, b, m = (self.iso[f"{label}.{figure}{of}"] for figure in figures)
            rows.append((of.strip("()"), format_conductance(c), format_figure(b), format_figure(m)))
        return rows


@dataclass(frozen=True)
class KineticLevel:
    """The kinetic friction of a recording, at its pressures (Pa) and speed (m/s)."""

    recording: str
    pressures: Mapping[str, float]
    speed: float
    friction: Figure = field(metadata=flat("friction:value ci95 unit"))


@dataclass(frozen=True)
class BreakAway:
    """The forces (N) at which the piston broke away in a recording, so many times: the median and both ends."""

    recording: str
    force: Figure = field(metadata=flat("value unit ci95"))
    least: float
    most: float
    count: int


@dataclass(frozen=True)
class OverPressure:
    """Kinetic friction as a line over p1 above ambient: N at ambient pressure, and N/Pa."""

    at_ambient: Figure
    slope: Figure


@dataclass(frozen=True)
class Repeats:
    """How far recordings at one pressure and speed agree: the mean friction, and its relative standard deviation."""

    recordings: Sequence[str]
    friction: float
    unit: str
    spread: float


@dataclass(frozen=True)
class Friction:
    """The friction of the recordings, and the models A to F."""

    warnings: Sequence[str]
    taken_out: Sequence[str]
    domain: Mapping[str, Any]
    models: Sequence[Mapping[str, Any]]
    kinetic: Sequence[KineticLevel]
    breakaway: Sequence[BreakAway]
    over_pressure: OverPressure | None
    repeats: Sequence[Repeats]
    deviations: Sequence[Mapping[str, Any]]

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """Friction by recording: its name, the pressure, kinetic friction, break-away."""
        kinetic, broken = {k.recording: k for k in self.kinetic}, {b.recording: b for b in self.breakaway}
        rows: list[tuple[str, ...]] = []
        for name in {**kinetic, **broken}:
            level, away = kinetic.get(name), broken.get(name)
            p1 = level.pressures.get("p1") if level else None
            sliding = format_figure(level.friction) if level else "–"
            held = f"{format_figure(away.force)} ({away.count} ×)" if away else "–"
            rows.append((name, format_quantity(p1, "Pa", 3), sliding, held))
        return rows

    @property
    def lines(self) -> Iterator[str]:
        """How friction grows with pressure, and how far recordings agree."""
        if line := self.over_pressure:
            slope, unit = line.slope, line.at_ambient.unit
            ends = [1e5 * end for end in (slope.low, slope.high)]
            growth = format_interval(1e5 * slope.value, f"{unit_symbol(unit)}/bar", ends)
            yield f"kinetic, over p1 above ambient: {format_figure(line.at_ambient)} + {growth}"
        for one in self.repeats:
            force, spread = format_quantity(one.friction, one.unit, 3), format_percent(one.spread)
            recordings = join_names(one.recordings)
            yield f"{recordings}, at one pressure and speed: {force} with a standard deviation of {spread}"


@dataclass(frozen=True)
class PressureLoss:
    """The pressure decay of one shut chamber.

    ``start`` and ``end`` are pressures in Pa at both ends of ``seconds``, ``percent`` the loss of gauge pressure for
    each second, relative to the start; the flow in l/min ANR follows for gas at the wall's temperature (``isothermal``)
    and for gas that takes up no heat (``adiabatic``). It is that of a litre where the volume is unknown.
    """

    recording: str
    start: float
    end: float
    seconds: float
    percent: float
    isothermal: float
    adiabatic: float
    volume_known: bool

    @property
    def text(self) -> str:
        """The decay and what it is as a flow."""
        of = "" if self.volume_known else " for each litre of volume"
        return (
            f"{self.recording}: {format_quantity(self.start, 'Pa')} to {format_quantity(self.end, 'Pa')} in "
            f"{format_number(self.seconds, 3)} s, {format_number(self.percent, 2)} %/s of the pressure above "
            f"ambient at first; in the mean {format_number(self.isothermal, 3)} l/min ANR{of} if the gas kept the "
            f"wall's temperature, {format_number(self.adiabatic, 3)} if it took none of its heat"
        )


@dataclass(frozen=True)
class LeakFlow:
    """The flow of one of the model's leaks from ``pressure`` (Pa) to ambient.

    It is that of a litre where the vessel's volume is unknown.
    """

    effect: str
    pressure: float
    flow: float
    volume_known: bool
    unit: str = FLOW_UNIT

    @property
    def text(self) -> str:
        """The flow in a sentence."""
        of = "" if self.volume_known else " for each litre of volume"
        text = f"{self.effect}: {format_number(self.flow, 3)} {self.unit}{of}"
        return f"{text} from {format_quantity(self.pressure, 'Pa', 3)} to ambient"


@dataclass(frozen=True)
class LeakArea:
    """What a leak's area takes for granted of heat: the area for gas that keeps the wall's temperature, or no heat."""

    name: str
    unit: str
    exponent: float
    isothermal: float
    adiabatic: float

    @property
    def text(self) -> str:
        """Both areas in a sentence."""
        isothermal, adiabatic = (format_quantity(area, self.unit) for area in (self.isothermal, self.adiabatic))
        return (
            f"{self.name} goes with the exponent {format_number(self.exponent, 3)} ([rig] thermal): {isothermal} "
            f"if the gas keeps the wall's temperature, {adiabatic} if it takes none of its heat"
        )


@dataclass(frozen=True)
class Leaks:
    """What shut chambers lost, what that is as a flow, and what an area takes for granted of heat."""

    lost: Sequence[PressureLoss]
    flows: Sequence[LeakFlow]
    areas: Sequence[LeakArea]

    @property
    def lines(self) -> list[str]:
        """One sentence each."""
        return [
            *(loss.text for loss in self.lost),
            *(flow.text for flow in self.flows),
            *(area.text for area in self.areas),
        ]


@dataclass(frozen=True)
class Source:
    """A source of a budget: its standard uncertainty in ``unit``, and what it contributes to that of the result.

    A ``bound`` has no standard uncertainty; ``factors`` are the least and the largest factor on the result.
    """

    source: str
    type_: str
    uncertainty: float
    unit: str
    sensitivity: float
    contribution: float
    share: float
    bound: bool
    factors: Sequence[float] | None


@dataclass(frozen=True)
class Budget:
    """The uncertainty budget of one result (GUM): its combined and its expanded (k = 2) uncertainty."""

    figure: Figure = field(metadata=flat("value unit interval:ci95"))
    combined: float
    expanded: float
    propagated: Sequence[float] | None
    calibration_not_stated: Sequence[str]
    sources: Sequence[Source]

    @property
    def thermal_factors(self) -> Sequence[float] | None:
        """The least and the largest factor for the heat of the wall; None where the model knows that heat."""
        return next((one.factors for one in self.sources if one.factors), None)

    def sentence(self, name: str) -> str:
        """Return how well the result is known, and from where its uncertainty comes."""
        at = f" at {name.partition('(')[2].rstrip(')')}" if "(" in name else ""
        text = f"C{at} is known to ± {format_number(100.0 * self.expanded / self.figure.value, 2)} % (k = 2)"
        certain = [one for one in self.sources if not one.bound]
        variance = sum(one.contribution**2 for one in certain)
        if variance > 0.0:
            main = max(certain, key=lambda one: one.contribution)
            share = format_percent(main.contribution**2 / variance)
            text += f"; main source: {main.source} (type {main.type_}, {share} of the variance)"
        if (factors := self.thermal_factors) is not None:
            least, largest = (format_number(factor, 3) for factor in factors)
            text += f"; the heat of the wall may make it {least} to {largest} × as large"
        if missing := self.calibration_not_stated:
            text += f"; no calibration is stated for {', '.join(missing)}"
        return text


@dataclass(frozen=True)
class Uncertainty:
    """The budgets of the characteristics by name."""

    coverage_factor: float
    budgets: Mapping[str, Budget]


@dataclass(frozen=True)
class Answer(StageAnswer):
    """What the recordings say of the model's parameters, of the valve and of friction."""

    model: ModelAnswer
    assumed: Sequence[Assumption]
    warnings: Sequence[str]
    contradicted: Sequence[LeftOut] | None = optional()
    valve: Valve | None = optional()
    valve_2: Valve | None = optional()
    friction: Friction | None = optional()
    leaks: Leaks | None = optional()
    flow: Flow | None = optional()
    uncertainty: Uncertainty | None = optional()

    @property
    def valves(self) -> dict[str, Valve]:
        """The valves by label."""
        return {label: one for label in ("valve", "valve_2") if (one := getattr(self, label)) is not None}

    @property
    def budgets(self) -> Mapping[str, Budget]:
        """The uncertainty budgets by the name of their result."""
        return self.uncertainty.budgets if self.uncertainty else {}

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the model, its parameters, warnings, and what to do next."""
        effects, flow = ", ".join(self.model.effects), self.flow
        listed = {n: p for n, p in self.model.parameters.items() if flow is None or n not in flow.parameters}
        if listed or flow is None:
            of = f" with {effects}" if effects else ""
            yield from labelled("found", f"{len(listed)} parameters of the base model{of}")
            rows = [(name, format_figure(one)) for name, one in listed.items()]
            yield from table(("parameter", "value, 95 % interval"), rows, texts=2)
        if flow is not None:
            yield from flow.lines
        yield from each("assumed", (f"{one.what} (to state it: {one.instead})" for one in self.assumed))
        for label, valve in self.valves.items():
            yield from labelled(label.replace("_", " "), valve.text)
            if by_command := valve.iso_rows(label):
                yield from table(ISO_COLUMNS, by_command, texts=4)
        if (largest := largest_conductance(self.budgets)) is not None:
            yield from labelled("budget", largest[1].sentence(largest[0]))
        if self.friction and (by_recording := self.friction.rows):
            yield from table(FRICTION_COLUMNS, by_recording, texts=4)
        yield from each("friction", self.friction.lines if self.friction else ())
        yield from each("leak", self.leaks.lines if self.leaks else ())
        yield from each("warning", self.warnings)
        yield from labelled("do", f"pneucli compare {file}")


def largest_conductance(budgets: Mapping[str, Budget]) -> tuple[str, Budget] | None:
    """Return name and budget of the largest C; None without one."""
    named = [(name, one) for name, one in budgets.items() if "sonic_conductance" in name]
    return max(named, key=lambda item: item[1].figure.value, default=None)
