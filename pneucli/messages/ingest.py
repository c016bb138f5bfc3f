"""What was read, and what had to be repaired."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import each, labelled, table, warnings
from pneucli.messages.formatting import format_plain
from pneucli.quantities import display_unit
from pneucli.units import parse_unit

Look = Mapping[str, Any]


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the number of recordings, each of them, and all repairs."""
    recordings = answer["recordings"]
    uses = [sum(one["use"] == use for one in recordings) for use in ("train", "test")]
    yield from labelled("read", f"{len(recordings)} recordings, {uses[0]} to fit and {uses[1]} to test")
    rows = [
        (one["name"], one["experiment"], one["use"], f"{one['samples']}", " ".join(one["signals"]))
        for one in recordings
    ]
    yield from table(("recording", "experiment", "use", "samples", "signals"), rows, texts=5)
    if "looks" in answer:
        yield ""
        yield from signal_summary_table(answer["looks"], {one["name"]: one["experiment"] for one in recordings})
        yield ""
    yield from each("left out", answer.get("left_out", []))
    repairs = [f"{repair_location(one)}: {one['message']}" for one in answer["repairs"]]
    for text in repairs:
        if text not in answer["warnings"]:  # which say the weightier ones
            yield from labelled("repair", text)
    yield from warnings(answer)
    yield from labelled("do", f"pneucli compare {file}")


def repair_location(repair: Mapping[str, Any]) -> str:
    """Return where something was repaired: the recording, and the signal where it is one."""
    return ", ".join(filter(None, (repair["recording"], repair["signal"])))


def plausibility_lines(answer: Mapping[str, Any], left_out: Sequence[Mapping[str, str | None]] = ()) -> Iterator[str]:
    """Yield the findings in an answer of ``ingest``: conflicts first; nothing where there are none.

    ``left_out`` has the recordings, or their signals, that a stage does not use for theirs.
    """
    groups: dict[str, list[Mapping[str, Any]]] = {"left out": [], "conflict": [], "doubt": []}
    for one in answer.get("plausibility", []):
        is_left_out = any(one["recording"] == p["recording"] and p["signal"] in (None, one["signal"]) for p in left_out)
        groups["doubt" if one["weight"] == "doubt" else "left out" if is_left_out else "conflict"].append(one)
    for label, group in groups.items():
        for text in implausibility_sentences(group):
            yield from labelled(label, text)


def implausibility_sentences(findings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return one sentence for each check, signal and weight, with the recordings that it was found in.

    The first recording speaks for all of them: its numbers are shown.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for one in findings:
        groups.setdefault((one["check"], one["signal"], one["weight"]), []).append(one)
    return [_sentence(group) for group in groups.values()]


def _sentence(group: Sequence[Mapping[str, Any]]) -> str:
    first, names = group[0], list(dict.fromkeys(one["recording"] for one in group))
    others = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return f"{names[0]}{others}, {first['found']}; {first['mend']}"


def signal_summary_table(summaries: Mapping[str, Mapping[str, Look]], experiments: Mapping[str, str]) -> Iterator[str]:
    """Yield a table: a row a signal of an experiment, over all its recordings.

    ``summaries`` maps recordings and signals to what ``ingest`` saw, ``experiments`` recordings to their experiment.
    """
    rows: dict[tuple[str, str], list[Look]] = {}
    for recording, signals in summaries.items():
        for signal, one in signals.items():
            rows.setdefault((experiments[recording], signal), []).append(one)
    head = ("experiment", "signal", "least", "median", "most", "noise", "unit", "rate")
    return table(head, [_row(*key, seen) for key, seen in rows.items()], texts=2)


def _row(experiment: str, signal: str, seen: Sequence[Look]) -> tuple[str, ...]:
    unit = display_unit(signal, seen[0]["unit"])
    factor, offset = parse_unit(unit).factor, parse_unit(unit).offset
    values = (min(s["least"] for s in seen), statistics.median(s["median"] for s in seen), max(s["most"] for s in seen))
    noise, rate = ([s[key] for s in seen if s[key] is not None] for key in ("noise", "rate"))
    return (
        *(experiment, signal),
        *(f"{format_plain((value - offset) / factor, 4)}" for value in values),
        f"{format_plain(statistics.median(noise) / factor, 2)}" if noise else "?",
        unit,
        f"{format_plain(statistics.median(rate), 4)} Hz" if rate else "?",
    )
