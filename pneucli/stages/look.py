"""``look``: raw files as ``init`` and ``ingest`` would take them, before there is a pipeline file to edit."""

import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.arrays import Array
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.figure import read
from pneucli.io.recordings import load_recordings
from pneucli.messages import look as messages
from pneucli.messages.envelope import envelope_indices, with_gap_indices
from pneucli.messages.ingest import Answer as Ingested
from pneucli.messages.init import Answer as Seen
from pneucli.messages.look import Answer, Rest, Signal
from pneucli.pipeline.graph import Context
from pneucli.quantities import SIGNALS
from pneucli.recording import Recording, Rig
from pneucli.stages import ingest, init

SCHEMA = "pneucli/look/1"
MAX_POINTS = 400  # of a curve, besides the first of each gap
REST_BLOCKS = 100  # stretches of a recording, of which each rests or moves
MAX_REST_RANGE = 0.02  # of a signal's range, over which it moves in a stretch in which it rests
MIN_REST_SHARE = 0.03  # of the time, that a level is worth being said
_WAITS = re.compile(r'"[^"#]*\?[^"]*"')


def look_at(raw: Sequence[Path], **stated: Any) -> Answer:
    """Return what raw files hold: columns as taken, and readings, rests and doubts of each recording.

    Args:
        raw: Files, folders and globs.
        stated: How texts are written, as ``init`` takes it.

    Returns:
        The answer that ``--json`` prints; ``recordings`` is empty where a ``?`` keeps them from being read, and
        ``doubts`` then says which.

    Raises:
        InputError: as ``init`` does.

    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "look"
        seen, waiting = write_pipeline(folder, raw, **stated)
        answer = Answer(SCHEMA, seen.recordings, seen.columns, seen.left_out, seen.cannot, [], [], [])
        try:
            ingested, own, _ = read_pipeline(folder / init.NAME, folder)
        except InputError as error:
            reason = f"{error.found}; {error.mend}" if error.mend else error.found
            return replace(answer, doubts=[*waiting, f"not read: {reason.replace(str(folder), '').strip()}"])
    doubts = [f"{one.recording}: {one.found}; {one.mend}" for one in ingested.plausibility]
    return replace(
        answer,
        recordings=[_recording(one) for one in own],
        repairs=[one.text for one in ingested.repairs],
        doubts=list(dict.fromkeys([*waiting, *doubts])),
    )


def write_pipeline(folder: Path, raw: Sequence[Path], **stated: Any) -> tuple[Seen, list[str]]:
    """Write a pipeline file for raw files; return the answer of ``init``, and what is asked of signals, in words."""
    seen = init.create(folder, raw, **stated)
    content, waiting = _without_waiting((folder / init.NAME).read_text(encoding="utf-8"))
    (folder / init.NAME).write_text(content, encoding="utf-8")
    return seen, waiting


def read_pipeline(pipeline: Path, folder: Path) -> tuple[Ingested, list[Recording], Rig]:
    """Return the answer of ``ingest``, the recordings and the rig of a pipeline file; its artifacts go to ``folder``.

    Raises InputError as ``ingest`` does.
    """
    context = Context(pipeline, load(pipeline), folder / "ingest", folder)
    ingested = read(Ingested, ingest.run(context))
    return ingested, load_recordings(context.out), context.config.to_rig()


def _without_waiting(text: str) -> tuple[str, list[str]]:
    """Return a pipeline file without the lines that wait to be filled in, and what is asked of signals, in words.

    A clock that is not known counts rows.
    """
    kept, waiting = [], []
    for line in text.splitlines():
        if not _WAITS.search(line.split("  #")[0]) or line.startswith("#"):
            kept.append(line)
            continue
        name, _, note = line.partition(" = ")
        if name == "time":
            kept.append('time = { expression = "row" }')
        if "{" in line:
            waiting.append(f"{name}: a ? waits: {note.partition('  # ')[2].replace('CHECK ', '')}")
    return "\n".join(kept) + "\n", waiting


def _recording(one: Recording) -> messages.Recording:
    return messages.Recording(
        name=one.name,
        experiment=one.experiment,
        samples=one.time.size,
        seconds=float(np.ptp(one.time)) if one.time.size else 0.0,
        rate=1.0 / one.period if one.time.size > 1 and one.period > 0 else None,
        signals=[_signal(one, name) for name in one.signals],
    )


def _signal(one: Recording, name: str) -> Signal:
    values = one[name]
    shown = with_gap_indices(envelope_indices([values], MAX_POINTS), values)
    return Signal(
        signal=name,
        unit=SIGNALS[name].unit,
        least=float(np.nanmin(values)),
        median=float(np.nanmedian(values)),
        most=float(np.nanmax(values)),
        missing=float(np.mean(np.isnan(values))),
        noise=one.noise[name].rms if name in one.noise else None,
        noise_ci95=one.noise[name].rms_interval if name in one.noise else None,
        rests=[Rest(level, share) for level, share in rests(values)],
        time=[round(float(t), 9) for t in one.time[shown]],
        values=[None if np.isnan(v) else float(v) for v in values[shown]],
    )


def rests(values: Array) -> Iterator[tuple[float, float]]:
    """Yield the levels at which a signal rests, and the share of the time that it does, the longest first.

    >>> [(round(level, 2), share) for level, share in rests(np.repeat([1.0, 5.0, 1.0, 3.0], [100, 50, 30, 20]))]
    [(1.0, 0.65), (5.0, 0.25), (3.0, 0.1)]
    """
    known = values[np.isfinite(values)]
    span = float(np.ptp(known)) if known.size else 0.0
    if known.size < REST_BLOCKS or not span:
        return
    blocks = np.array_split(known, REST_BLOCKS)
    still = np.array([float(np.median(part)) for part in blocks if np.ptp(part) <= MAX_REST_RANGE * span])
    levels, shares = np.unique(np.round((still - known.min()) / (MAX_REST_RANGE * span)), return_counts=True)
    for at in np.argsort(-shares, kind="stable"):
        share = float(shares[at]) / REST_BLOCKS
        if share >= MIN_REST_SHARE:
            near = np.round((still - known.min()) / (MAX_REST_RANGE * span)) == levels[at]
            yield float(np.median(still[near])), share
