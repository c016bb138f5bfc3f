"""How far the model is from the measurement, and where."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.formatting import (
    format_noise_ratio,
    format_number,
    format_percent,
    format_quantity,
    in_display_unit,
    join_names,
    unit_symbol,
)
from pneucli.quantities import SIGNALS

FIGURES = (
    ("steady_um", "error at rest", "m", 1e-6),
    ("cycle_um", "moves at rest", "m", 1e-6),
    ("tracking_rms_um", "error on the way, rms", "m", 1e-6),
    ("overshoot_um", "overshoot", "m", 1e-6),
    ("settling_s", "settles in", "s", 1.0),
    ("fast_v", "command above 50 Hz, rms", "V", 1.0),
    ("load_estimate_n", "estimate of the load, mean", "N", 1.0),
)
COLUMN_TITLES = ("figure", "predicted", "measured")
Row = Mapping[str, Any]
# times the error of a correct model: a smaller excess is immaterial, however significant (measured on exams,
# docs/method.md; held-out recordings have commands between the fitted ones); a larger one than the last counts in a
# single channel, too, and no uncertainty of the parameters makes it adequate
GOOD_ERROR_RATIO, GOOD_TEST_ERROR_RATIO, BAD_ERROR_RATIO = 1.2, 1.4, 2.0
MAX_WITHIN_RATIO = 0.7  # of the held-out error: the rest is half of the squares
MAX_EVENTS = 3  # events, without -v
TITLES = {"direction": "direction of motion", "p_ratio": "pressure ratio"}
_DIRECTIONS = {-1: "toward −x", 0: "at rest", 1: "toward +x"}
_VERDICTS = {"good": "the model stands at the noise floor", "bad": "the model misses something"}


def lines(answer: Row, file: str, verbose: bool) -> Iterator[str]:
    """Yield the verdict, where the error stands, and what to do next."""
    yield from labelled("error", verdict(answer))
    if worst := worst_channel_sentence(answer):
        yield from labelled("worst", worst)
    if free_run := free_run_sentence(answer):
        yield from labelled("free run", free_run)
    if beyond := beyond_fitted_sentence(answer, answer.get("error", {}).get("test")):
        yield from labelled("beyond", beyond)
    for i, event in enumerate(grouped_regions(answer)[: None if verbose else MAX_EVENTS]):
        yield from labelled("" if i else "where", describe_event(event))
    for i, log in enumerate(controller_log_lines(answer)):
        yield from labelled("" if i else "loop", log)
    yield from labelled("do", f"pneucli {'diagnose' if lacks_something(answer) else 'run'} {file}")
    if verbose:
        yield ""
        yield from _channels(answer["channels"])


def rating(ratio: float | None, limit: float | None = None) -> str:
    """Return whether an error, in units of the noise floor, is good or bad, or neither.

    An error within the ``limit`` of a correct model is good.
    """
    if ratio is None:
        return ""
    return "good" if ratio <= max(GOOD_ERROR_RATIO, limit or 0.0) else "bad" if ratio > BAD_ERROR_RATIO else ""


def evaluation_error(errors: Row) -> tuple[str, float | None]:
    """Return the use that a model is judged by, test where there is such a recording, and its error."""
    use = "train" if errors.get("test") is None else "test"
    return use, errors.get(use)


def overall_rating(answer: Row) -> str:
    """Return the rating of the model's error by the one judgement of it, ``lack_of_fit``; "" between good and bad."""
    judged = answer.get("lack_of_fit")
    if judged is None:
        return rating(evaluation_error(answer.get("error", {}))[1])
    if not judged["present"]:
        return "" if judged["undetermined"] else "good"
    return "bad" if judged["error"] > BAD_ERROR_RATIO else ""


def lacks_something(answer: Row) -> bool:
    """Whether the model misses something, or its parameters are too uncertain to tell."""
    judged = answer.get("lack_of_fit")
    return overall_rating(answer) != "good" if judged is None else judged["present"] or judged["undetermined"]


def fit_meaning(answer: Row) -> str:
    """Return what the error of the model means, by the one judgement of it."""
    judged = answer.get("lack_of_fit")
    if judged is None:
        return _VERDICTS.get(overall_rating(answer), "the model comes near the noise")
    if judged["undetermined"]:
        return "its parameters are too uncertain to tell whether the model misses something"
    if not judged["present"]:
        return _VERDICTS["good"]
    if judged["error"] > BAD_ERROR_RATIO:
        return _VERDICTS["bad"]
    worst = judged["worst"]
    where = f", in {worst['channel']} of {worst['recording']} most" if worst else ""
    return f"the model comes near the noise and misses something{where}"


def verdict(answer: Row) -> str:
    """Return the error against the noise floor, of the test recordings where there are any."""
    errors = answer.get("error", {})
    use, error = evaluation_error(errors)
    if error is None:
        return "no channel was compared"
    judged = answer.get("lack_of_fit")
    notes = []
    if use == "test" and errors.get("train") is not None:
        notes.append(f"{format_noise_ratio(errors['train'])} on those fitted")
    if judged is not None and error <= BAD_ERROR_RATIO * judged["limit"]:
        beside = f" with {excused_segments(judged['excused'])}" if judged.get("excused") else ""
        notes.append(f"of correct models 99 % are below {format_noise_ratio(judged['limit'])}{beside}")
    other = f" ({'; '.join(notes)})" if notes else ""
    kind = "test recordings" if use == "test" else "the recordings that were fitted; none was held out"
    return f"{format_noise_ratio(error)} × noise on {kind}{other}: {fit_meaning(answer)}"


def excused_segments(count: int) -> str:
    """Return how many segments tell nothing of the model: when a piston breaks away decides on their error."""
    return f"{'one segment' if count == 1 else f'{count} segments'} beside a break-away"


def worst_channel_sentence(answer: Row) -> str:
    """Return the worst channel where it is far off, which a mean over all may hide; else nothing."""
    bad = [c for c in answer.get("channels", []) if rating(c["ratio_to_noise"], c.get("ratio_limit")) == "bad"]
    if not bad:
        return ""
    worst = max(bad, key=lambda c: c["ratio_to_noise"])
    rmsd = format_quantity(worst["rmsd"], worst["unit"], 3)
    ratio = format_noise_ratio(worst["ratio_to_noise"])
    return f"{worst['channel']} in {worst['recording']}, {ratio} × noise ({rmsd} rms)"


def free_run_sentence(answer: Row) -> str:
    """Return how far the model is off over a whole recording, where its printed error does not say so; else nothing."""
    judged = answer.get("lack_of_fit")
    if not answer.get("free_run") or judged is None or judged["error"] > BAD_ERROR_RATIO:
        return ""
    worst = answer["free_run"][0]
    share = f"by {format_number(worst['percent'], 2)} % of its range" if worst["percent"] else "away"
    return (
        f"Over the whole recording {worst['recording']}, {worst['channel']} drifts {share} "
        f"({format_noise_ratio(worst['ratio_to_noise'])} × noise)."
    )


def beyond_fitted_sentence(answer: Row, error: float | None) -> str:
    """Return where held-out recordings go beyond the fitted ones, where half of the squared ``error`` is there."""
    within = answer.get("error_within_fitted")
    if within is None or error is None or within > MAX_WITHIN_RATIO * error:
        return ""
    worst = answer["beyond_fitted"][0]
    fitted, reached = (format_quantity(worst[end], worst["unit"], 3) for end in ("from", "to"))
    where = f"{locator_title(worst['signal'])} to {reached}, fitted to {fitted}"
    return (
        f"{worst['recording']} goes beyond the fitted recordings: {where}. Within their range the error is "
        f"{format_noise_ratio(within)} × noise; for more, fit such recordings, too."
    )


def even_error_sentence(answer: Row) -> str:
    """Return what it means that no region holds more of the error than of the samples."""
    if lacks_something(answer):
        return "The error is spread over all samples: no interval stands out."
    return "No channel exceeds its noise notably."


def test_first(channels: Iterable[Row]) -> list[Row]:
    """Return the channels' errors, test recordings before training recordings."""
    return sorted(channels, key=lambda c: c["use"] != "test")


def grouped_regions(answer: Row) -> list[list[Row]]:
    """Return the regions in groups that hold the same error, worst first."""
    found: dict[int, list[Row]] = {}
    for i, region in enumerate(answer.get("where", [])):
        found.setdefault(region.get("event", i), []).append(region)
    return list(found.values())


def describe_event(event: Sequence[Row]) -> str:
    """Return one line on one event: who sees it, where it stands, how much of the error it holds."""
    lead = event[0]
    channels = join_names(list(dict.fromkeys(region["channel"] for region in event)))
    when = next((r for r in event if r["signal"] == "time"), lead)
    places = ", ".join(dict.fromkeys((describe_region(when), describe_region(lead))))
    return (
        f"{lead['recording']}: {channels} at {places}; {format_percent(lead['share_of_error'])} of the error of "
        f"{lead['channel']} in {format_percent(lead['share_of_samples'])} of the samples"
    )


def describe_region(region: Row) -> str:
    """Return what a region is over, and its span: ``"piston velocity −35.0 to 0 mm/s"``."""
    return f"{locator_title(region['signal'])} {region_span(region)}"


def locator_title(signal: str) -> str:
    """Return what a locator is called."""
    return SIGNALS[signal].title if signal in SIGNALS else TITLES.get(signal, signal)


def region_span(region: Row) -> str:
    """Return from where to where a region goes."""
    if region["signal"] == "direction":
        return " or ".join(name for sign, name in _DIRECTIONS.items() if region["from"] <= sign <= region["to"])
    low, high = (format_number(float(in_display_unit(float(region[end]), region["unit"])), 3) for end in ("from", "to"))
    return f"{low} to {high} {unit_symbol(region['unit'])}".rstrip()


def _channels(channels: Iterable[Row]) -> Iterator[str]:
    head = ("recording", "use", "channel", "rms error", "of range", "× noise", "99 % below")
    rows = [
        (
            *(c["recording"], c["use"], c["channel"], format_quantity(c["rmsd"], c["unit"], 3)),
            *(
                "–" if c["percent"] is None else f"{format_number(c['percent'], 3)} %",
                format_noise_ratio(c["ratio_to_noise"]),
                "–" if c.get("ratio_limit") is None else format_noise_ratio(c["ratio_limit"]),
            ),
        )
        for c in test_first(channels)
    ]
    return table(head, rows, texts=3)


def figure_rows(log: Row) -> Iterator[tuple[str, str, str]]:
    """Yield title, prediction and measurement of the figures that the log shows."""
    for name, title, unit, scale in FIGURES:
        predicted, measured = log["foretold"].get(name), log["measured"].get(name)
        if predicted is not None or measured is not None:
            yield title, _shown(predicted, unit, scale), _shown(measured, unit, scale)


def _shown(value: float | None, unit: str, scale: float) -> str:
    return "never" if value is None else format_quantity(scale * value, unit, 3)


def controller_log_lines(answer: Row) -> Iterator[str]:
    """Yield a sentence for each log."""
    for log in answer.get("closed_loop", ()):
        figures = "; ".join(
            f"{title} {measured} ({predicted} predicted)" for title, predicted, measured in figure_rows(log)
        )
        yield f"{log['recording']}, {log['controller']}: {figures}"
