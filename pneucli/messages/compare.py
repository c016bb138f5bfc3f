"""The answer of ``compare``: how far the model is from the measurement, and where."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from pneucli.figure import Figure, optional
from pneucli.messages import StageAnswer, labelled, table
from pneucli.messages.formatting import (
    format_fit,
    format_noise_ratio,
    format_number,
    format_percent,
    format_quantity,
    in_display_unit,
    join_names,
    unit_symbol,
)
from pneucli.quantities import SIGNALS

DELAY_OVERSHOOT = 0.65  # of a delay, above which the pressure overshoots by more than a lag lets it: 0.3 to 0.5
FIGURES = (
    ("steady_um", "error at rest", "m", 1e-6),
    ("cycle_um", "moves at rest", "m", 1e-6),
    ("tracking_rms_um", "error on the way, rms", "m", 1e-6),
    ("overshoot_um", "overshoot", "m", 1e-6),
    ("settling_s", "settles in", "s", 1.0),
    ("fast_v", "command above 50 Hz, rms", "V", 1.0),
    ("load_estimate_n", "estimate of the load, mean", "N", 1.0),
)
CHANNEL_TITLES = ("recording", "use", "channel", "rms error", "of range", "fit", "noise", "× noise", "99 % below")
COLUMN_TITLES = ("figure", "predicted", "measured")
# times the error of a correct model: a smaller excess is immaterial, however significant (measured on exams,
# docs/method.md; held-out recordings have commands between the fitted ones); a larger one than the last counts in a
# single channel, too, and no uncertainty of the parameters makes it adequate
GOOD_ERROR_RATIO, GOOD_TEST_ERROR_RATIO, BAD_ERROR_RATIO = 1.2, 1.4, 2.0
MAX_WITHIN_RATIO = 0.7  # of the held-out error: the rest is half of the squares
MAX_EVENTS = 3  # events, without -v
TITLES = {"direction": "direction of motion", "p_ratio": "pressure ratio"}
_DIRECTIONS = {-1: "toward −x", 0: "at rest", 1: "toward +x"}
_VERDICTS = {"good": "the model stands at the noise floor", "bad": "the model misses something"}
Errors = Mapping[str, float | None]  # over noise by use: train, test


@dataclass(frozen=True)
class ChannelResult:
    """Errors of one channel in one recording, SI.

    ``noise`` is the rms error of a correct model; 99 % of correct models have a ratio below ``ratio_limit``, which is
    None where it is unknown. ``free_run`` is the error over the whole recording, None where there is none.
    """

    recording: str
    use: str
    channel: str
    unit: str
    rmsd: float
    percent: float
    relative_error_percent: float
    fit_percent: float
    noise: float
    ratio_to_noise: float
    measured_range: float
    ratio_limit: float | None = None
    free_run: Mapping[str, float | None] | None = optional()

    def in_units_of(self, noise: float) -> ChannelResult:
        """Return the same error beside another rms error of a correct model, in SI."""
        return replace(self, noise=noise, ratio_to_noise=self.rmsd / noise if noise > 0 else float("nan"))

    @property
    def key(self) -> tuple[str, str]:
        """Recording and channel."""
        return self.recording, self.channel

    @property
    def row(self) -> tuple[str, ...]:
        """The row of a table under ``CHANNEL_TITLES``."""
        return (
            *(self.recording, self.use, self.channel, format_quantity(self.rmsd, self.unit, 3)),
            "–" if math.isnan(self.percent) else f"{format_number(self.percent, 3)} %",
            *(format_fit(self.fit_percent), format_quantity(self.noise, self.unit, 3)),
            *("–" if ratio is None else format_noise_ratio(ratio) for ratio in (self.ratio_to_noise, self.ratio_limit)),
        )


@dataclass(frozen=True)
class Region:
    """A range of one signal in one recording, and its share of the channel's squared error.

    Regions of one ``event`` hold the same error, seen over several signals or in several channels; 0 is the worst.
    """

    recording: str
    channel: str
    signal: str
    from_: float
    to: float
    unit: str
    share_of_error: float
    share_of_samples: float
    event: int = 0

    @property
    def span(self) -> str:
        """From where to where it goes."""
        if self.signal == "direction":
            return " or ".join(name for sign, name in _DIRECTIONS.items() if self.from_ <= sign <= self.to)
        low, high = (format_number(float(in_display_unit(end, self.unit)), 3) for end in (self.from_, self.to))
        return f"{low} to {high} {unit_symbol(self.unit)}".rstrip()

    @property
    def text(self) -> str:
        """What it is over, and its span: ``"piston velocity −35.0 to 0 mm/s"``."""
        return f"{locator_title(self.signal)} {self.span}"


@dataclass(frozen=True)
class ToleranceUse:
    """One channel of one recording: its rms error ``value`` and the ``tolerance``, both in ``unit`` (SI)."""

    recording: str
    channel: str
    value: float
    tolerance: float
    unit: str

    @property
    def ratio(self) -> float:
        """The error over the tolerance; 1 is the limit."""
        return self.value / self.tolerance


@dataclass(frozen=True)
class Purpose:
    """Whether every channel stays within its tolerance, and the channel that uses most of it."""

    adequate: bool
    worst: ToleranceUse


@dataclass(frozen=True)
class WorstChannel:
    """The channel that a correct model explains least."""

    recording: str
    channel: str
    ratio_to_noise: float


@dataclass(frozen=True)
class ExcessBalance:
    """The subsystem that errs by more than noise."""

    subsystem: str
    channel: str
    times_noise: float


@dataclass(frozen=True)
class LackOfFit:
    """The one judgement of a model's error.

    ``present``: the error exceeds what a correct model would show. ``use``: the recordings that it is judged by,
    ``test`` where there are any. ``error``: their printed error; ``limit``: below which the model counts as correct.
    ``p``: the probability of so large an error, or of so large a one of a single channel, if the model were correct and
    its parameters and the noise as uncertain as they are. ``undetermined``: the error is large, and the parameters, or
    the noise, are too uncertain to tell why. ``excused``: so many segments beside a break-away tell nothing of the
    model; the limit has room for what they add. ``worst``: the channel that a correct model explains least; None where
    all are within it. ``balance``: the subsystem that errs most by more than noise, which the whole model may hide.
    """

    present: bool
    p: float
    undetermined: bool
    use: str
    error: float
    limit: float
    excused: int
    worst: WorstChannel | None = None
    balance: ExcessBalance | None = None

    @property
    def meaning(self) -> str:
        """What the error of the model means."""
        if self.undetermined:
            return "its parameters, or the noise, are too uncertain to tell whether the model misses something"
        if not self.present:
            return _VERDICTS["good"]
        if self.error > BAD_ERROR_RATIO:
            return _VERDICTS["bad"]
        where = f", in {self.worst.channel} of {self.worst.recording} most" if self.worst else ""
        return f"the model comes near the noise and misses something{where}"

    @property
    def rating(self) -> str:
        """Whether the error is good or bad; "" between."""
        if not self.present:
            return "" if self.undetermined else "good"
        return "bad" if self.error > BAD_ERROR_RATIO else ""


@dataclass(frozen=True)
class Divergence:
    """A channel that drifts away over a whole recording, SI, with its error and its limit."""

    recording: str
    channel: str
    unit: str
    rmsd: float
    percent: float
    ratio_to_noise: float
    ratio_limit: float | None


@dataclass(frozen=True)
class BeyondFitted:
    """The samples of a held-out recording at which one signal is beyond the fitted range.

    ``share`` and ``share_of_error`` are those of the recording's samples, and of its squared error over noise in all
    channels, at these samples and after them up to the next restart: the model ran through them. ``from_`` is the end
    of the fitted range that the recording passes furthest, ``to`` how far it goes, both in ``unit`` (SI).
    """

    recording: str
    signal: str
    share: float
    from_: float
    to: float
    unit: str
    share_of_error: float


@dataclass(frozen=True)
class Commissioned:
    """What a commissioning found: its state, and where it ended well the figures of the machine.

    Attributes:
        state: State of the chart in words.
        null_1: What was added to the null command of valve 1 in V.
        null_2: Likewise of valve 2.
        delay: Delay from command to pressure in s.
        overshoot: Its share that overshoots in s: all of a pure delay, about a third of a lag.
        gain: Rate of the pressure over that of the model.
        member: Number of the member of the family, 0: as designed.
        swing: Length of the last swing at rest in m.
        swing_period: Its period in s.
    """

    state: str
    null_1: float
    null_2: float
    delay: float
    overshoot: float
    gain: float
    member: int
    swing: float
    swing_period: float

    @property
    def sentence(self) -> str:
        """What the machine is, in a sentence."""
        if not self.delay:
            return f"commissioning: {self.state}"
        kind = "delay, as of a hose" if self.overshoot > DELAY_OVERSHOOT * self.delay else "lag, as of a spool"
        nulls = " and ".join(format_quantity(v, "V", 2) for v in (self.null_1, self.null_2) if v) or "0 V"
        delay = format_quantity(1e3 * self.delay, "ms", 2)
        gains = f"gains of member {self.member}" if self.member else "gains as designed"
        text = f"{self.state}: null off by {nulls}, {delay} from command to pressure (mostly a {kind})"
        return f"{text}, the pressure's rate {format_number(self.gain, 2)} of the model's; {gains}"


@dataclass(frozen=True)
class ControllerLog:
    """A log of a running controller: the figures of the loop as predicted and as measured, by name."""

    recording: str
    use: str
    controller: str
    hash: str
    precision: str
    began: str
    supply_told: bool
    foretold: Mapping[str, float | None]
    measured: Mapping[str, float | None]
    commissioned: Commissioned | None = None

    @property
    def rows(self) -> Iterator[tuple[str, str, str]]:
        """Title, prediction and measurement of the figures that the log shows."""
        for name, title, unit, scale in FIGURES:
            pair = [figures.get(name) for figures in (self.foretold, self.measured)]
            if pair != [None, None]:
                told, seen = ("never" if v is None else format_quantity(scale * v, unit, 3) for v in pair)
                yield title, told, seen

    @property
    def sentence(self) -> str:
        """The figures in a sentence."""
        figures = "; ".join(f"{title} {measured} ({predicted} predicted)" for title, predicted, measured in self.rows)
        machine = f"; {self.commissioned.sentence}" if self.commissioned else ""
        return f"{self.recording}, {self.controller}: {figures}{machine}"


@dataclass(frozen=True)
class ModelAnswer:
    """A model: the effects beside the base model, and its parameters by name."""

    effects: Sequence[str]
    parameters: Mapping[str, Figure]


@dataclass(frozen=True)
class LeftOut:
    """What is left out because it cannot be true: a recording, or one signal of it."""

    recording: str
    signal: str | None


@dataclass(frozen=True)
class Answer(StageAnswer):
    """How far the model is from each recording, and where (interface, section 3)."""

    horizon_s: float
    model: ModelAnswer
    channels: Sequence[ChannelResult]
    error: Errors
    where: Sequence[Region]
    purpose: Purpose | None
    data: str
    contradicted: Sequence[LeftOut]
    beyond_fitted: Sequence[BeyondFitted]
    error_within_fitted: float | None
    lack_of_fit: LackOfFit | None
    free_run: Sequence[Divergence]
    closed_loop: Sequence[ControllerLog]
    without_pressure: Sequence[str] | None = optional()
    number: int = 0
    when: str = ""

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield the verdict, where the error stands, and what to do next."""
        yield from labelled("error", self.verdict)
        beyond = beyond_fitted_sentence(self.beyond_fitted, self.error_within_fitted, self.error.get("test"))
        drift = free_run_sentence(self.lack_of_fit, self.free_run)
        for label, text in (("worst", self.worst_channel), ("free run", drift), ("beyond", beyond)):
            if text:
                yield from labelled(label, text)
        for i, event in enumerate(self.events[: None if verbose else MAX_EVENTS]):
            yield from labelled("" if i else "where", describe_event(event))
        for i, log in enumerate(self.closed_loop):
            yield from labelled("" if i else "loop", log.sentence)
        yield from labelled("do", self.next_step(file))
        if verbose:
            yield ""
            yield from table(CHANNEL_TITLES, [c.row for c in test_first(self.channels)], texts=3)

    def next_step(self, file: str) -> str:
        """Return what to do next; ``diagnose`` names nothing where no recording has a pressure."""
        blind = set(self.without_pressure or ())
        all_blind = bool(blind) and {one.recording for one in self.channels} <= blind
        if all_blind and lacks_something(self.lack_of_fit, self.error):
            return "record p1: from motion alone diagnose names no effect"
        return f"pneucli {next_command(self.lack_of_fit, self.error)} {file}"

    @property
    def verdict(self) -> str:
        """The error against the noise floor, of the test recordings where there are any."""
        use, error = evaluation_error(self.error)
        if error is None:
            return "no channel was compared"
        judged, notes = self.lack_of_fit, []
        if use == "test" and self.error.get("train") is not None:
            notes.append(f"{format_noise_ratio(self.error['train'])} on those fitted")
        if judged is not None and error <= BAD_ERROR_RATIO * judged.limit:
            beside = f" with {excused_segments(judged.excused)}" if judged.excused else ""
            notes.append(f"of correct models 99 % are below {format_noise_ratio(judged.limit)}{beside}")
        other = f" ({'; '.join(notes)})" if notes else ""
        kind = "test recordings" if use == "test" else "the recordings that were fitted; none was held out"
        meaning = judged.meaning if judged else _VERDICTS.get(self.rating, "the model comes near the noise")
        return f"{format_noise_ratio(error)} × noise on {kind}{other}: {meaning}"

    @property
    def rating(self) -> str:
        """The rating of the model's error by the one judgement of it; "" between good and bad."""
        return self.lack_of_fit.rating if self.lack_of_fit else rating(evaluation_error(self.error)[1])

    @property
    def worst_channel(self) -> str:
        """The worst channel where it is far off, which a mean over all may hide; else nothing."""
        bad = [c for c in self.channels if rating(c.ratio_to_noise, c.ratio_limit) == "bad"]
        if not bad:
            return ""
        worst = max(bad, key=lambda c: c.ratio_to_noise)
        ratio, rmsd = format_noise_ratio(worst.ratio_to_noise), format_quantity(worst.rmsd, worst.unit, 3)
        return f"{worst.channel} in {worst.recording}, {ratio} × noise ({rmsd} rms)"

    @property
    def even_error(self) -> str:
        """What it means that no region holds more of the error than of the samples."""
        if lacks_something(self.lack_of_fit, self.error):
            return "The error is spread over all samples: no interval stands out."
        return "No channel exceeds its noise notably."

    @property
    def events(self) -> list[list[Region]]:
        """The regions in groups that hold the same error, worst first."""
        found: dict[int, list[Region]] = {}
        for region in self.where:
            found.setdefault(region.event, []).append(region)
        return list(found.values())


def rating(ratio: float | None, limit: float | None = None) -> str:
    """Return whether an error, in units of the noise floor, is good or bad, or neither.

    An error within the ``limit`` of a correct model is good.
    """
    if ratio is None:
        return ""
    return "good" if ratio <= max(GOOD_ERROR_RATIO, limit or 0.0) else "bad" if ratio > BAD_ERROR_RATIO else ""


def evaluation_error(errors: Errors) -> tuple[str, float | None]:
    """Return the use that a model is judged by, test where there is such a recording, and its error."""
    use = "train" if errors.get("test") is None else "test"
    return use, errors.get(use)


def lacks_something(judged: LackOfFit | None, error: Errors) -> bool:
    """Whether the model misses something, or its parameters are too uncertain to tell."""
    return rating(evaluation_error(error)[1]) != "good" if judged is None else judged.present or judged.undetermined


def next_command(judged: LackOfFit | None, error: Errors) -> str:
    """Return the command that a comparison asks for."""
    return "diagnose" if lacks_something(judged, error) else "run"


def excused_segments(count: int) -> str:
    """Return how many segments tell nothing of the model: when a piston breaks away decides on their error."""
    return f"{'one segment' if count == 1 else f'{count} segments'} beside a break-away"


def free_run_sentence(judged: LackOfFit | None, diverging: Sequence[Divergence]) -> str:
    """Return how far the model is off over a whole recording, where its printed error does not say so; else nothing."""
    if not diverging or judged is None or judged.error > BAD_ERROR_RATIO:
        return ""
    worst = diverging[0]
    share = f"by {format_number(worst.percent, 2)} % of its range" if worst.percent > 0.0 else "away"
    return (
        f"Over the whole recording {worst.recording}, {worst.channel} drifts {share} "
        f"({format_noise_ratio(worst.ratio_to_noise)} × noise)."
    )


def beyond_fitted_sentence(beyond: Sequence[BeyondFitted], within: float | None, error: float | None) -> str:
    """Return where held-out recordings go beyond the fitted ones, where half of the squared ``error`` is there."""
    if within is None or error is None or within > MAX_WITHIN_RATIO * error:
        return ""
    worst = beyond[0]
    fitted, reached = (format_quantity(end, worst.unit, 3) for end in (worst.from_, worst.to))
    where = f"{locator_title(worst.signal)} to {reached}, fitted to {fitted}"
    return (
        f"{worst.recording} goes beyond the fitted recordings: {where}. Within their range the error is "
        f"{format_noise_ratio(within)} × noise; for more, fit such recordings, too."
    )


def test_first(channels: Iterable[ChannelResult]) -> list[ChannelResult]:
    """Return the channels' errors, test recordings before training recordings."""
    return sorted(channels, key=lambda c: c.use != "test")


def describe_event(event: Sequence[Region]) -> str:
    """Return one line on one event: who sees it, where it stands, how much of the error it holds."""
    lead = event[0]
    channels = join_names(list(dict.fromkeys(region.channel for region in event)))
    when = next((r for r in event if r.signal == "time"), lead)
    places = ", ".join(dict.fromkeys((when.text, lead.text)))
    return (
        f"{lead.recording}: {channels} at {places}; {format_percent(lead.share_of_error)} of the error of "
        f"{lead.channel} in {format_percent(lead.share_of_samples)} of the samples"
    )


def locator_title(signal: str) -> str:
    """Return what a locator is called."""
    return SIGNALS[signal].title if signal in SIGNALS else TITLES.get(signal, signal)
