"""The answers of ``plan``: manoeuvres, steps for a person, what was refused, and what a plan decided."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pneucli.figure import Figure, flat
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.diagnose import REJECTION_REASONS
from pneucli.messages.formatting import format_figure, format_percent, format_plain, format_quantity, join_names

GOOD_POWER = 0.8  # of an effect that the recordings would show

MANOEUVRES = {
    "steps": "steps of {level} and −{level} from the null command",
    "stairs": "stairs up to {level} and down to −{level}",
    "random-steps": "random steps of up to {level} to both sides, each held for 0.05 to 0.6 s",
    "hold": "open with {level} for a moment, then hold at the null command",
    "command-sine": "a sine of {level} at {frequency} at the valve",
    "triangle": "a slow triangle of {level} about the null command",
    "pulses": "short openings of {level} to both sides",
    "motion-sine": "a position sine of {level} about {centre} at {frequency}",
    "strokes": "strokes of {level} about {centre} at {speed}",
    "position-steps": "steps of the position of up to {level}, with rests",
    "starts-after-rests": "slow starts of {level} after rests of 0.2, 1 and 4 s",
    "small-reversals": "reversals of {level} at {frequency}",
    "strokes-at-pressure": "strokes of {level} about {centre} at {speed}, from {pressure} in chamber 2",
    "machine-strokes": "strokes of {level} at {speed} and {pressure}",
    "shut-valve": "shut the ball valve at chamber 1 and hold for 12 s",
    "known-force": "strokes of {level} at {speed} against a known force of {force}",
}
BY_HAND = {
    "shut-valve": "Fill chamber 1 at rest, then shut the ball valve between valve and chamber 1 before the recording "
    "starts; open it afterwards.",
    "known-force": "Hang a weight of {mass} on a rope over a pulley so that it pulls the piston {direction}; remove it "
    "afterwards.",
}
DRIVES = {  # in a few words, and for a person who sets it up
    "valve": ("commands at the valve", "commands at the valve"),
    "position": ("position loop", "a position loop with {gain}, or your own"),
    "motion": ("position followed by the bench", "the bench's own drive follows the position"),
    "machine": ("imposed by the machine", "the machine follows the position at a held pressure"),
}
RUNNING_RULES = (
    "Bring the piston to the first position by hand or with low speed before each recording.",
    "Save each recording as its own file, NAME as in the table, with the same channels as before.",
    "Stop at once when the piston touches an end: send the null command.",
)
CHAMBERS_2 = {"closed": "chamber 2 closed", "open": "chamber 2 open", "valve": "chamber 2 at its valve", None: ""}
QUANTITIES = {
    "x": "position",
    "v": "speed",
    "p1": "pressure of chamber 1",
    "p2": "pressure of chamber 2",
    "force": "net pressure force",
    "air": "air",
}


@dataclass(frozen=True)
class PlannedRecording:
    """A recording of a plan: its bench, its manoeuvre (SI), its times in ``commands.csv``, and what it shows.

    ``times_noise`` has the rms difference of each rival from the best model over the noise, by effect.
    """

    use: str
    kind: str
    bench: str
    experiment: str
    drive: str
    column: str
    chamber_2: str | None
    chamber: int | None
    imposed: str | None
    valve: str | None
    start: Mapping[str, float]
    gain: float | None
    centre: float
    level: float | None
    frequency: float | None
    speed: float | None
    pressure: float | None
    force: float
    added_mass: float
    by_hand: str | None
    name: str = ""
    begin: float = 0.0
    end: float = 0.0
    times_noise: Mapping[str, float] = field(default_factory=dict)

    @property
    def manoeuvre(self) -> str:
        """The manoeuvre as a phrase."""
        quantity = "V" if self.drive == "valve" else "m"
        return MANOEUVRES[self.kind].format(
            centre=format_quantity(self.centre, "m", 3),
            level="" if self.level is None else format_quantity(abs(self.level), quantity, 3),
            frequency=f"{format_plain(self.frequency or 0.0)} Hz",
            speed=format_quantity(self.speed, "m/s", 3),
            pressure=format_quantity(self.pressure, "Pa", 3),
            force=format_quantity(self.force, "N", 3),
        )

    @property
    def begins_at(self) -> str:
        """Where it starts: a vessel has one pressure, a cylinder two and a position."""
        moves = self.bench == "cylinder"
        names = ("p1", "p2") if moves else ("p1",)
        pressures = [f"{name} near {format_quantity(self.start[name], 'Pa', 2)} (absolute)" for name in names]
        return f"x = {format_quantity(self.start['x'], 'm', 3)}, {join_names(pressures)}" if moves else pressures[0]

    @property
    def driven(self) -> str:
        """How the bench is driven."""
        how = DRIVES[self.drive][1].format(gain=format_quantity(self.gain or 0.0, "V/m", 3))
        return ", ".join(filter(None, [how, CHAMBERS_2[self.chamber_2]]))

    @property
    def drive_title(self) -> str:
        """How it is driven, in a few words."""
        return "with a step by hand" if self.by_hand else DRIVES[self.drive][0]

    @property
    def row(self) -> tuple[str, ...]:
        """The row of the table on a terminal."""
        return self.name, self.use, self.manoeuvre, self.bench, f"{self.end - self.begin:.1f}"


@dataclass(frozen=True)
class ManualStep:
    """What a person does before a recording."""

    recording: str
    text: str


@dataclass(frozen=True)
class ExceededLimit:
    """A limit that a manoeuvre exceeds: the quantity, its most extreme value, the limit, the unit (SI)."""

    quantity: str
    value: float
    limit: float
    unit: str


@dataclass(frozen=True)
class RefusedManoeuvre:
    """A manoeuvre that would exceed a limit in a model."""

    text: str
    bench: str
    model: str
    exceeded: ExceededLimit = field(metadata=flat())

    @property
    def reason(self) -> str:
        """Why it was refused."""
        one = self.exceeded
        value, limit = (format_quantity(size, one.unit, 3) for size in (one.value, one.limit))
        return f"{self.text}: {QUANTITIES[one.quantity]} {value} against the limit {limit} ({self.model})"


@dataclass(frozen=True)
class RivalAnswer:
    """A hypothesis in question; the best model has no effect."""

    name: str
    effect: str | None
    present: bool
    probability: float | None
    in_place_of: str | None


@dataclass(frozen=True)
class Expected:
    """How probable an effect is now, and how probably the recordings show it if it is there."""

    effect: str
    rival: str
    probability_before: float | None
    power: float

    @property
    def is_shown(self) -> bool:
        """Whether the recordings would show it."""
        return self.power >= GOOD_POWER


@dataclass(frozen=True)
class Power:
    """The power of a plan to find an effect of one size.

    Attributes:
        effect: Name of the effect.
        parameter: Its leading parameter.
        size: Distance of the parameter from its null; the value itself where it has no null; infinite: never found.
        unit: Unit of the size.
        power: Probability that an effect of this size is found.
        typical: Whether the size is the typical one; else it is the smallest with a power of 80 %.
    """

    effect: str
    parameter: str
    size: float
    unit: str
    power: float
    typical: bool


@dataclass(frozen=True)
class Answer(StageAnswer):
    """The next experiment (interface, section 7)."""

    first: bool
    seconds: float
    recordings: Sequence[PlannedRecording]
    manual: Sequence[ManualStep]
    limits: Mapping[str, Any]
    refused: Sequence[RefusedManoeuvre]
    refused_count: int
    rivals: Sequence[RivalAnswer]
    warnings: Sequence[str]
    expected: Sequence[Expected]
    sentence: str = ""
    power: Sequence[Power] = ()
    files: Sequence[str] = ()
    folder: str = ""

    @property
    def purpose(self) -> str:
        """What the plan is for, in one sentence."""
        count = sum(r.use == "train" for r in self.recordings)
        held_out, seconds = len(self.recordings) - count, f"{self.seconds:.0f} s"
        recordings = f"{count} recordings and {held_out} to be held out, {seconds} of machine time"
        found = f"{sum(e.is_shown for e in self.expected)} of {len(self.expected)}"
        if self.first or len(self.rivals) == 1:
            question = "" if self.first else "no effect is in question, and "
            return f"{recordings}: {question}{found} effects would be shown at their typical size (80 %)."
        names = join_names(list(dict.fromkeys(r.effect for r in self.rivals if r.effect is not None)))
        return f"{recordings}, to decide about {names}: {found} would be shown if they are true (80 %)."

    @property
    def limit_texts(self) -> list[str]:
        """The limits that the plan keeps, one sentence each."""
        texts = []
        if self.limits["position"] is not None:
            low, high = (format_quantity(x, "m", 3) for x in self.limits["position"])
            texts.append(f"The plan keeps the piston between {low} and {high}.")
        shown = (
            ("max_speed", "m/s", "speed"), ("max_pressure", "Pa", "pressure (absolute)"), ("max_force", "N", "force"),
        )  # fmt: skip
        texts += [
            f"Highest {title}: {format_quantity(self.limits[key], unit, 3)}."
            for key, unit, title in shown
            if self.limits[key] is not None
        ]
        return texts

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the plan, its expected outcome and the next step; with ``-v`` also refused manoeuvres."""
        yield from labelled("plan", self.sentence)
        if self.recordings:
            yield from table(("recording", "use", "manoeuvre", "bench", "s"), [r.row for r in self.recordings], texts=4)
        yield from each("by hand", (f"{step.recording}: {step.text}" for step in self.manual))
        expected = sorted(self.expected, key=lambda e: -e.power)
        if found := [f"{e.rival} {format_percent(e.power)}" for e in expected[:8]]:
            yield from labelled("power", f"probability that the recordings show what is true: {join_names(found)}")
        yield from labelled("files", join_names(self.files))
        if self.recordings:
            do = f"record {self.folder}/commands.csv as steps.md says, then: pneucli plan {file} --take FILE..."
            yield from labelled("do", do)
        yield from each("warning", self.warnings)
        if verbose:
            yield from each("refused", (one.reason for one in self.refused))

    def steps_page(self, file: str) -> str:
        """Return ``steps.md``: what a person does, in order; ``file`` is the pipeline file."""
        parts = [f"# Next experiment for {self.pipeline}", "", self.sentence, "", "## Before", ""]
        parts += [f"- {rule}" for rule in (*RUNNING_RULES, *self.limit_texts)]
        parts += ["", "## Recordings", ""]
        setup = None
        for number, r in enumerate(self.recordings, 1):
            if setup != (setup := f"**On the {r.bench}** ({r.driven}):"):
                parts += [setup, ""] if number == 1 else ["", setup, ""]
            use = "fitted" if r.use == "train" else "held out: never fitted"
            parts.append(f"{number}. `{r.name}` ({r.end - r.begin:.1f} s, {use}): {r.manoeuvre}.")
            parts.append(f"   Start at rest: {r.begins_at}.")
            if r.by_hand:
                parts.append(f"   By hand: {r.by_hand}")
            parts.append(f"   Commands: `commands.csv` from {r.begin:.2f} s to {r.end:.2f} s, column `{r.column}`.")
        parts += ["", "## After", "", "Take the recordings in, in this order:", ""]
        names = " ".join(f"{r.name}.csv" for r in self.recordings)
        return "\n".join([*parts, f"    pneucli plan {file} --take {names}", ""])


def by_hand_text(kind: str, force: float, mass: float) -> str:
    """Return what a person has to do for a manoeuvre; force of the weight in N toward +x, its mass in kg."""
    direction = "away from x = 0" if force > 0.0 else "toward x = 0"
    return BY_HAND[kind].format(mass=format_quantity(mass, "kg", 3), direction=direction)


@dataclass(frozen=True)
class TakenRecording:
    """A recording that was added to the pipeline file."""

    name: str
    file: str
    use: str


@dataclass(frozen=True)
class Diagnosed:
    """What a diagnosis said, in brief."""

    verdict: str | None
    missing: Sequence[str]
    probabilities: Mapping[str, float | None]
    indistinguishable: Mapping[str, Sequence[str]]
    unexplained_share: float | None


@dataclass(frozen=True)
class TakenEffect:
    """The probability of an effect before and after, and whether it is ``named`` or ``refused`` now."""

    effect: str
    before: float | None
    after: float | None
    reason: str | None
    now: str | None


@dataclass(frozen=True)
class Decided:
    """An effect that is named or refused now."""

    effect: str
    now: str


@dataclass(frozen=True)
class TakenParameter:
    """A parameter of an effect before and after."""

    name: str
    before: Figure | None
    after: Figure


@dataclass(frozen=True)
class Taken(StageAnswer):
    """What the recordings of a plan changed."""

    recordings: Sequence[TakenRecording]
    before: Diagnosed
    after: Diagnosed
    effects: Sequence[TakenEffect]
    decided: Sequence[Decided]
    parameters: Sequence[TakenParameter]
    sentence: str

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield what was taken and what it decided, with probabilities and sizes before and after."""
        yield from labelled("taken", f"{join_names([r.name for r in self.recordings])} into {file}")
        yield from labelled("found", self.sentence)
        rows = [(e.effect, *map(format_percent, (e.before, e.after)), self._change(e.effect)) for e in self.effects]
        if rows:
            yield from table(("effect", "before", "after", "named"), rows, texts=1)
        for reason in dict.fromkeys(one.reason for one in self.effects):
            if reason in REJECTION_REASONS:
                alike = join_names([one.effect for one in self.effects if one.reason == reason])
                yield from labelled("refused", f"{alike}. {REJECTION_REASONS[reason]}")
        for one in self.parameters:
            was = "not fitted" if one.before is None else format_figure(one.before)
            yield from labelled("size", f"{one.name}: {was} → {format_figure(one.after)}")
        if self.before.verdict != self.after.verdict:
            yield from labelled("verdict", f"{self.before.verdict or 'no diagnosis'} → {self.after.verdict}")

    def _change(self, effect: str) -> str:
        """Return whether an effect was named, and is now."""
        now = effect in self.after.missing
        return ("as before" if now else "no longer") if effect in self.before.missing else "now" if now else ""


def taken_sentence(missing: Sequence[str], decided: Sequence[Decided]) -> str:
    """Return what new recordings decided; ``missing`` has the effects that are named now."""
    new, gone = ([one.effect for one in decided if one.now == now] for now in ("named", "refused"))
    parts = [f"{join_names(new)} {'is' if len(new) == 1 else 'are'} now named"] if new else []
    parts += [f"{join_names(gone)} is no longer named"] if gone else []
    named = join_names(missing) or "no effect"
    return f"{'; '.join(parts)}." if parts else f"The recordings decide nothing new: {named} is named as before."


def distinguishing_experiment(names: tuple[str, str], procedures: tuple[str, str]) -> str:
    """Return how to distinguish two effects by the procedures that their declarations state."""
    one, other = procedures
    return f"To tell {names[0]} from {names[1]}: {one}" + (f" {other}" if other != one else "")


def discriminating_manoeuvre(manoeuvre: str | None, channel: str = "", times_noise: float = 0.0) -> str:
    """Return the simulated manoeuvre in which two models differ most; None: they differ by no more than noise."""
    if manoeuvre is None:
        return "In no simulated manoeuvre do the two fitted models differ by more than noise."
    return (
        f"In simulation the two fitted models differ most in this manoeuvre: {manoeuvre}; "
        f"{channel} differs by {format_plain(times_noise, 2)} times its noise (rms)."
    )


def discrepancy_experiment(
    procedures: Sequence[tuple[str, str]], channel: str, subsystem: str, variable: str | None
) -> str:
    """Return what to record about a discrepancy, with the procedure of each effect that may be it, by name."""
    tests = "".join(f"To test {name}: {procedure} " for name, procedure in procedures)
    return (
        f"{tests}The discrepancy is in {channel} ({subsystem}). Repeat a recording unchanged, then record "
        f"another range or order of {variable or 'each signal'}: what recurs over it belongs to the rig."
    )


def detecting_experiment(name: str, procedure: str) -> str:
    """Return what to record to detect an effect that these recordings cannot detect."""
    return f"These recordings cannot detect {name}: {procedure}"
