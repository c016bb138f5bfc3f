"""The answer of ``design``: corners and sectors, the bench of laws, the margins, and the gate."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pneucli.figure import flat
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.formatting import (
    format_bounded,
    format_noise_ratio,
    format_number,
    format_percent,
    format_plain,
    format_quantity,
    join_names,
)
from pneucli.messages.simulate import Figures

CAUSES = {
    "": "",
    "travel-time": "the valve is too small: {distance} take at least {time}",
    "speed": "the valve is too small: {asked} are asked, it keeps up with {reachable}",
    "stiffness": "the valve is too small and the air spring too soft: both together give at most {reachable}",
    "resolution": "the position sensor is too coarse: {resolvable}",
    "pressure-bounds": "supply and surroundings bound the pressures",
    "one-spool": (
        "one 5/3 valve fills a chamber as it vents the other: the mean pressure follows from leaks and overlap, too "
        "slowly to be set; two valves set it"
    ),
    "open-chamber-2": "chamber 2 is open, so one valve sets the force alone; two valves set both pressures",
    "sealed-chamber-2": (
        "chamber 2 holds what was sealed in, so one valve sets the force alone; two valves set both pressures"
    ),
}
"""Why the plant cannot meet a requirement, by the code of the cause."""

UNITS = {
    "travel-time": {"distance": (1e3, "mm"), "time": (1.0, "s")},
    "speed": {"asked": (1e3, "mm/s"), "reachable": (1e3, "mm/s")},
    "stiffness": {"reachable": (1.0, "N/m")},
    "resolution": {"resolvable": (1e6, "um")},
}
"""Factor on the SI value and shown unit of each quantity of a cause."""


LOOP_TITLES = {
    "command": "at the command",
    "command 2": "at the second command",
    "position": "at the position's reading",
}
MARGIN_TITLES = ("loop cut", "upper gain margin", "lower gain margin", "phase margin", "delay margin", "modulus margin")
Scenarios = Mapping[str, Figures]  # by their names
Cases = Mapping[str, Scenarios]  # by controller
LAW_TITLES = (
    "at rest, µm",
    "moves there, µm",
    "on the way, µm rms",
    "load, s",
    "over 50 Hz, V",
    "air, g",
    "in sliding",
    "result at rest",
)
LAW_LEGEND = (
    "the largest error at rest, how far the piston moves there, the rms error on the way, the time to reject a load to "
    "50 µm, the command's rms above 50 Hz, the share of samples in which the disturbance observers slide: each the "
    "worst of all scenarios; and the air of all of them"
)


@dataclass(frozen=True)
class Quantity:
    """A value in its unit."""

    value: float
    unit: str


@dataclass(frozen=True)
class SectorAnswer:
    """A sliding sector (:class:`pneucli.design.sliding.SlidingSector`), and why it is not followed, if so."""

    a_1: float
    a_2: float
    lambda_1: float
    lambda_2: float
    mass: float
    period: float
    speed_floor: float
    eta: float
    steepness: float
    remark: str

    @property
    def text(self) -> str:
        """Its lines, and the speed down to which it resolves friction."""
        slopes = f"λ {format_number(self.lambda_1, 3)} and {format_number(self.lambda_2, 3)} 1/s"
        steep = "; too steep for the sample time, so the law takes the sector of [design] eta" if self.remark else ""
        return f"{slopes}, friction resolved down to {format_quantity(self.speed_floor, 'm/s', 2)}{steep}"


@dataclass(frozen=True)
class Matching:
    """Whether the matching condition holds; ``broken_by`` has the states on which each disturbance acts."""

    holds: bool
    broken_by: Mapping[str, Sequence[str]]

    @property
    def text(self) -> str:
        """Whether it holds, or what breaks it."""
        broken = "; ".join(f"{name} acts on {', '.join(states)}" for name, states in self.broken_by.items())
        return "the matching condition holds" if self.holds else f"the matching condition does not hold: {broken}"


@dataclass(frozen=True)
class DecayRate:
    """The decay rate that a PDC reaches with weights of a type; None where there is none, as ``status`` says."""

    weight_type: str
    rate: float | None
    unit: str
    status: str
    verified: bool

    @property
    def text(self) -> str:
        """The rate, or why there is none."""
        if self.rate is None:
            return f"none: {self.status.splitlines()[0]}"
        verified = "verified" if self.verified else "not verified"
        return f"decay rate {format_quantity(self.rate, '1/s', 3)}, {verified}"


@dataclass(frozen=True)
class MatrixInequalities:
    """PDC by type of weight; ``vertex_loops`` are poles of the ``best`` (real, imaginary) in 1/s, by vertex."""

    best: str | None
    types: Sequence[DecayRate]
    vertex_loops: Sequence[Sequence[Sequence[float]]]


@dataclass(frozen=True)
class WorstMargins:
    """The smallest margins of one loop; None where there is no limit.

    Attributes:
        gain_up: Factor by which the gain may rise; infinite: any.
        gain_down: Factor by which the gain may fall; 0: any.
        phase: Phase margin in rad.
        delay: Additional delay in s; infinite: any.
        modulus: Least distance of the return ratio L from -1.
    """

    gain_up: float | None
    gain_down: float | None
    phase: float
    delay: float | None
    modulus: float


@dataclass(frozen=True)
class LoopMargins(WorstMargins):
    """The margins of one loop, and its highest frequency in rad/s with ``|L| = 1``; NaN: none."""

    crossover: float


@dataclass(frozen=True)
class MarginPoint:
    """The margins of one loop at a place (m) and a speed (m/s)."""

    loop: str
    x: float
    speed: float
    stable: bool
    margins: LoopMargins = field(metadata=flat())


@dataclass(frozen=True)
class Poles:
    """The slowest poles (real, imaginary) of the loop at a place (m) and a speed (m/s)."""

    x: float
    speed: float
    unit: str
    poles: Sequence[Sequence[float]]


@dataclass(frozen=True)
class StickingPoint:
    """A place (m) at which the piston does not slide steadily in a direction."""

    x: float
    direction: float


@dataclass(frozen=True)
class Margins:
    """The margins of each loop at each operating point, and the smallest ones by loop."""

    points: Sequence[MarginPoint]
    worst: Mapping[str, WorstMargins]
    poles: Sequence[Poles]
    stable: bool
    stuck: Sequence[StickingPoint]
    left_out: Sequence[str]
    overlap: Quantity
    units: Mapping[str, str]

    @property
    def lines(self) -> Iterator[str]:
        """A sentence a loop."""
        for loop, worst in self.worst.items():
            _, rise, fall, phase, later, _ = margin_row(loop, worst)
            yield f"{LOOP_TITLES[loop]}: gain {rise} or {fall}, phase {phase}, {later} later"

    @property
    def doubts(self) -> Iterator[str]:
        """What is to be warned of: a loop that grows, or a piston that does not slide."""
        grows = sorted({format_quantity(p.x, "m", 3) for p in self.points if not p.stable})
        if grows:
            yield f"the loop is not stable for small signals at {join_names(grows)}"
        if self.stuck:
            where = join_names(sorted({format_quantity(p.x, "m", 3) for p in self.stuck}))
            yield f"the piston does not slide steadily at {where} at any slow speed, so it has no margin there"

    @property
    def validity(self) -> str:
        """To what the margins apply, in a sentence or two."""
        speeds = [abs(p.speed) for p in self.points]
        if not speeds:
            return "Nothing slid steadily: there are no margins."
        text = f"Small signals about a piston that slides at {format_quantity(min(speeds), 'm/s', 2)}"
        text += f" to {format_quantity(max(speeds), 'm/s', 2)}" if max(speeds) > 1.01 * min(speeds) else ""
        text += "; a piston that sticks does not follow small signals: see the closed-loop scenarios."
        if self.overlap.value > 0.0:
            overlap = format_quantity(self.overlap.value, "V", 2)
            text += f" Nor does the valve within its overlap of {overlap}, over which the inverse map jumps."
        if self.left_out:
            text += f" Left out, as small signals are lost in it: {join_names([t.lower() for t in self.left_out])}."
        return text


@dataclass(frozen=True)
class MissedRequirement:
    """A requirement that is not met: the worst figure (None: never), where, the share of draws, and the cause."""

    demand: str
    limit: float
    found: float | None
    unit: str
    axis: str
    scenario: str
    share: float
    cause: str

    @property
    def sentence(self) -> str:
        """What is asked and found, where, and why."""
        found = "never" if self.found is None else format_quantity(self.found, self.unit, 3)
        asked = f"{found} where {format_quantity(self.limit, self.unit, 3)} is asked"
        text = f"{self.demand.replace('_', ' ')}: {asked} ({self.axis}, {self.scenario})"
        return text + (f": {self.cause}" if self.cause else "")


@dataclass(frozen=True)
class Demand:
    """A requirement and its limit."""

    demand: str
    limit: float
    unit: str


@dataclass(frozen=True)
class Gate:
    """Whether the controller meets every requirement on ``axes``; a ``strict`` one fails like a check.

    ``model_error`` is the model's, over the noise.
    """

    passed: bool
    strict: bool
    missed: Sequence[MissedRequirement]
    asked: Sequence[Demand]
    axes: int
    model_error: float | None
    model_error_limit: float

    @property
    def verdict(self) -> str:
        """In one line, whether every requirement is met."""
        asked = ", ".join(f"{d.demand.replace('_', ' ')} {format_quantity(d.limit, d.unit, 3)}" for d in self.asked)
        if not self.missed:
            return f"met on the model, at the ends of its intervals and on draws ({self.axes} axes): {asked}"
        return f"{len(self.missed)} of {len(self.asked)} requirements are not met"

    @property
    def violations(self) -> Iterator[str]:
        """A sentence for each requirement that is not met, and one where the model is far from its data."""
        yield from (one.sentence for one in self.missed)
        if self.model_error is not None and self.model_error > self.model_error_limit:
            yield (
                f"the model is {format_noise_ratio(self.model_error)} × noise from its data: what is designed for it "
                "need not hold on the machine"
            )


@dataclass(frozen=True)
class Held:
    """The rigs that one controller holds, and its figures over their limits: the worst and the median."""

    rigs: int
    held: int
    probability: float
    worst: Figures
    median: Figures

    @property
    def row(self) -> tuple[str, ...]:
        """Rigs that it holds, and each figure, median and worst."""
        cells = (f"{_times(self.median[n])}; {_times(self.worst[n])}" for n in ENSEMBLE_FIGURES)
        return f"{self.held} of {self.rigs}", *cells


@dataclass(frozen=True)
class Ensemble:
    """What the gains promise on rigs that differ as the recordings allow, and have ``effects`` that the model lacks.

    Of the rigs that fail, ``explained`` ran without each effect and ``rescued`` then held; ``separate`` excludes the
    ``limiting`` one.
    """

    effects: Sequence[str]
    spool_lag: Quantity
    confidence: float
    limits: Mapping[str, Quantity]
    laws: Mapping[str, Held]
    limiting: str | None
    explained: int
    rescued: Mapping[str, int]
    separate: str | None

    @property
    def promise(self) -> Iterator[str]:
        """The promise of ``best``, and which untold effect limits it."""
        own = self.laws["best"]
        asked = ", ".join(
            f"{format_quantity(self.limits[name].value, self.limits[name].unit, 2)} {where}"
            for name, where in ENSEMBLE_FIGURES.items()
        )
        probability, sure = format_percent(own.probability), format_percent(self.confidence)
        yield (
            f"holds {asked} on {own.held} of {own.rigs} rigs that the search did not see: on a rig like yours with "
            f"a probability of at least {probability} (confidence {sure})"
        )
        if self.effects:
            lacks = join_names(self.effects)
            yield f"these rigs differ as the recordings allow, and have {lacks}, which the model lacks"
        if self.limiting:
            yield (
                f"{self.limiting} limits it: {self.rescued[self.limiting]} of {self.explained} rigs that fail hold "
                f"without it. To exclude or to identify it: {self.separate}"
            )

    @property
    def rows(self) -> Iterator[tuple[str, ...]]:
        """A row a controller: rigs that it holds, and its figures over their limits, median and worst."""
        yield from ((name, *held.row) for name, held in self.laws.items())


@dataclass(frozen=True)
class SlidingLine:
    """A sliding line of a system: the method that found it, its row S, pole and slope (1/s), whether it is taken."""

    system: str
    method: str
    surface: Sequence[float]
    pole: float
    slope: float
    taken: bool


@dataclass(frozen=True)
class Answer(StageAnswer):
    """How the controller was designed; ``requirements`` are in SI."""

    requirements: Mapping[str, Any]
    corners: Mapping[str, Quantity]
    sector: Mapping[str, SectorAnswer]
    matching: Mapping[str, Matching]
    surface: Sequence[SlidingLine]
    lmi: MatrixInequalities
    controllers: Mapping[str, str]
    not_made: Mapping[str, str]
    tolerance_um: float
    compare: Cases
    without_map: Cases
    ablation: Cases
    variants: Cases
    warnings: Sequence[str]
    margins: Margins | None
    gate: Gate | None
    ensemble: Ensemble | None

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the corners of the cascade, what the theory says of the axis, warnings, and what to do next."""
        corners = [f"{n.replace('_', ' ')} {format_number(c.value, 3)} rad/s" for n, c in self.corners.items()]
        period = format_plain(1e3 * self.requirements["period"])
        yield from labelled("found", f"a cascade at {period} ms: {', '.join(corners)}")
        yield from each("sector", (f"{name}: {one.text}" for name, one in self.sector.items()))
        if verbose:
            yield from each("match", (f"{name} system: {one.text}" for name, one in self.matching.items()))
            yield from each("PDC", (f"weights {one.weight_type}: {one.text}" for one in self.lmi.types))
        yield from self._laws("controller", self.compare)
        if self.ensemble:
            yield ""
            yield from table(ENSEMBLE_TITLES, list(self.ensemble.rows), texts=1)
        yield from each("lacks", (f"{name}: {why}" for name, why in self.not_made.items()))
        if verbose:
            yield from self._laws("cascade without", self.ablation)
        yield from self._margins_and_acceptance(verbose)
        yield from each("warning", self.warnings)
        yield from labelled("do", f"pneucli simulate {file}")

    def _laws(self, title: str, cases: Cases) -> Iterator[str]:
        if cases:
            yield ""
            yield from table((title, *LAW_TITLES), list(law_rows(cases, self.tolerance_um)), texts=1)

    def _margins_and_acceptance(self, verbose: bool) -> Iterator[str]:
        """Yield the margins of the loop, and what the gate found."""
        if (found := self.margins) and found.points:
            yield from each("margins", [*found.lines, *([found.validity] if verbose else [])])
            yield from each("warning", found.doubts)
        if self.ensemble:
            yield from each("rigs", self.ensemble.promise)
        if held := self.gate:
            yield from labelled("gate", held.verdict)
            yield from each("misses" if held.strict else "warning", held.violations)

    @property
    def comparison(self) -> str:
        """In one sentence, which laws hold the tolerance at rest, and how far off the others stay."""
        tolerance, cases = self.tolerance_um, self.compare
        if not tolerance > 0.0 or len(cases) < 2:
            return ""
        off = {name: worst_value(figures, "steady_um") for name, figures in cases.items()}
        hold = [name for name, figures in cases.items() if rest_verdict(figures, tolerance) == "holds"]
        others = sorted((um, name) for name, um in off.items() if name not in hold and um is not None)
        named = join_names([f"“{name}”" for name in hold]) or "none"
        text = f"of {len(cases)} laws {named} {'holds' if len(hold) < 2 else 'hold'} it"
        runner_up = f"; next is “{others[0][1]}”, {_length(others[0][0])} off" if others else ""
        return f"{text[:1].upper()}{text[1:]}{runner_up}."


def cause_text(code: str, quantities: Mapping[str, float]) -> str:
    """Return why the plant cannot meet a requirement; "" where the cause is unknown.

    >>> cause_text("speed", {"asked": 2.0, "reachable": 1.25})
    'the valve is too small: 2000 mm/s are asked, it keeps up with 1250 mm/s'
    """
    units = UNITS.get(code, {})
    return CAUSES[code].format(
        **{n: f"{format_plain(v * units[n][0], 3)} {units[n][1]}" for n, v in quantities.items()}
    )


def fails_acceptance(gate: Gate | None) -> bool:
    """Whether an unmet requirement fails like a check."""
    return bool(gate and gate.strict and not gate.passed)


def margin_row(loop: str, worst: WorstMargins) -> tuple[str, ...]:
    """Return the smallest margins of one loop as texts, in the order of MARGIN_TITLES."""
    rise = "× any" if worst.gain_up is None else f"× {format_number(worst.gain_up, 3)}"
    fall = "× any" if not worst.gain_down else f"× {format_number(worst.gain_down, 2)}"
    later = "any" if worst.delay is None else f"{format_number(1e3 * worst.delay, 2)} ms"
    phase = f"{format_number(math.degrees(worst.phase), 2)}°"
    return LOOP_TITLES[loop], rise, fall, phase, later, format_number(worst.modulus, 2)


def observer_at_bound(law: str, observer: str, scenario: str, share: float, limit: float) -> str:
    """Return the warning about a disturbance observer that does not slide; the shares of samples are 0 to 1.

    >>> observer_at_bound("pdc", "force", "sine", 0.35, 0.2)  # doctest: +ELLIPSIS
    'pdc: the force observer is at its bound M_k in 35 % of the samples of sine, above 20 %: its estimate is not ...'
    """
    return (
        f"{law}: the {observer} observer is at its bound M_k in {100 * share:.0f} % of the samples of {scenario}, "
        f"above {100 * limit:.0f} %: its estimate is not the disturbance"
    )


def law_rows(cases: Cases, tolerance_um: float) -> Iterator[list[str]]:
    """Yield a row a controller: the worst of all its scenarios, the air of all, and what it comes to."""
    for name, figures in cases.items():
        recovery = [f["recovery_s"] for f in figures.values() if f["peak_um"] is not None]
        longest = None if None in recovery else max((r for r in recovery if r is not None), default=math.nan)
        air = sum(f["air_kg"] or 0.0 for f in figures.values())
        yield [
            name,
            *(format_number(worst_value(figures, key), 3) for key in ("steady_um", "cycle_um", "tracking_rms_um")),
            format_bounded(longest, 2),
            format_number(worst_value(figures, "fast_v"), 2),
            format_number(1e3 * air, 3),
            _sliding(figures),
            rest_verdict(figures, tolerance_um),
        ]


def _sliding(figures: Scenarios) -> str:
    """Return the least share of samples in sliding, of both observers over all scenarios."""
    shares = [f.get(key) for f in figures.values() for key in ("sliding_load", "sliding_flow")]
    finite = [share for share in shares if share is not None]
    return f"{100.0 * min(finite):.0f} %" if finite else "–"


def worst_value(figures: Scenarios, key: str) -> float | None:
    """Return the largest value of a figure over all scenarios; None where none shows it."""
    return max((f[key] for f in figures.values() if f[key] is not None), default=None)  # type: ignore[type-var]


def rest_verdict(figures: Scenarios, tolerance_um: float) -> str:
    """Return what becomes of the piston at rest: held, off the reference, moving."""
    off, moved = (worst_value(figures, key) or 0.0 for key in ("steady_um", "cycle_um"))
    faults = [f"stays up to {_length(off)} off"] if off > tolerance_um else []
    faults += [f"moves by {_length(moved)} at rest"] if moved > tolerance_um else []
    return ", ".join(faults) or "holds"


def _length(um: float) -> str:
    """Return a length as people say it."""
    return f"{format_number(um, 2)} µm" if um < 1000.0 else f"{format_number(1e-3 * um, 2)} mm"


def shortcomings(cases: Cases, tolerance_um: float) -> list[str]:
    """Return a sentence for each controller that does not hold the tolerance at rest."""
    verdicts = {name: rest_verdict(figures, tolerance_um) for name, figures in cases.items()}
    return [f"{name} {verdict}" for name, verdict in verdicts.items() if verdict != "holds"]


ENSEMBLE_TITLES = ("controller", "rigs held", "at rest", "in motion", "under the load", "chattering")
ENSEMBLE_FIGURES = {
    "rest": "at rest",
    "motion": "rms in motion",
    "load": "under a load",
    "chattering": "rms of chattering",
}


def _times(ratio: float | None) -> str:
    return "∞" if ratio is None else f"{format_number(ratio, 2)} ×"
