"""Write a player of planned commands as C and structured text, with a safe start and stop.

The player holds the segments of each recording, so it needs no file. It starts from rest with a ramp to the first
position, and with another one where a position loop follows commands at the valve. It keeps the commands within their
range, and shuts the valve for good when a reading leaves its limits.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from pneucli.export import structured_text
from pneucli.export.controller_program import fill_template
from pneucli.io.artifacts import write_text
from pneucli.plan.bench import Profile, hold, ramp
from pneucli.version import __version__

NO_LIMIT = 1e30
FILES = {"c": ("pneucli_player.h", "pneucli_player.c"), "st": ("pneucli_player.st",)}
PERIOD = 1e-3  # s, of the task that calls the player


@dataclass(frozen=True)
class PlayedRecording:
    """One recording for the player.

    Attributes:
        name: Its name.
        is_position: Whether the segments state a position in m; else the command in V.
        gain: Gain in V/m of the player's position loop; 0: the bench follows the reference itself.
        segments: The command over time.
        rest: Time in s after it, at its last value.
    """

    name: str
    is_position: bool
    gain: float
    segments: Profile
    rest: float


@dataclass(frozen=True)
class PlayerLimits:
    """What the player keeps, SI.

    Attributes:
        null: Command in V at which nothing flows.
        command: Largest command in V from it.
        position: Lowest and highest position; None: not watched.
        pressure: Highest absolute pressure; None: not watched.
        soft_start: Time from the first reading to the first position, at least.
        max_speed: Highest speed of that way; None: not limited.
        mirrored: Whether a second valve gets the negated command.
    """

    null: float
    command: float
    position: tuple[float, float] | None
    pressure: float | None
    soft_start: float
    max_speed: float | None
    mirrored: bool


def write_players(
    folder: Path, targets: Collection[str], recordings: Sequence[PlayedRecording], limits: PlayerLimits, pipeline: str
) -> None:
    """Write the player for each target.

    Args:
        folder: The folder.
        targets: ``c``, ``st`` or both.
        recordings: The recordings, in their order.
        limits: What the player keeps.
        pipeline: Name of the pipeline.
    """
    for target in sorted(targets):
        for name in FILES[target]:
            write_text(folder / name, player_text(name, recordings, limits, pipeline))


def player_text(name: str, recordings: Sequence[PlayedRecording], limits: PlayerLimits, pipeline: str) -> str:
    """Return one of the files of :data:`FILES`."""
    rows = _rows(recordings)
    low, high = limits.position or (-NO_LIMIT, NO_LIMIT)
    numbers = [number for row in rows for number in row]
    is_c = name.endswith((".c", ".h"))
    written = repr if is_c else structured_text.number
    line = "    {}," if is_c else "        {},"
    table = "\n".join(line.format(", ".join(written(float(v)) for v in row)) for row in rows)
    return fill_template(
        name.replace("pneucli_", ""),
        VERSION=__version__,
        PIPELINE=pipeline.replace("*/", "* /").replace("*)", "* )"),
        PERIOD=written(float(PERIOD)),
        SEGMENTS=str(len(rows)),
        LAST_NUMBER=str(len(numbers) - 1),
        TABLE=table if is_c else table.rstrip(","),
        NULL=written(float(limits.null)),
        COMMAND=written(float(limits.command)),
        LOW=written(float(low)),
        HIGH=written(float(high)),
        PRESSURE=written(float(limits.pressure or NO_LIMIT)),
        SOFT_START=written(float(limits.soft_start)),
        SPEED=written(float(limits.max_speed or NO_LIMIT)),
        MIRRORED="1" if limits.mirrored else "0",
        MIRRORED_ST="TRUE" if limits.mirrored else "FALSE",
        NAMES=" ".join(f"{i}: {r.name};" for i, r in enumerate(recordings, 1)),
    )


def _rows(recordings: Sequence[PlayedRecording]) -> list[tuple[float, ...]]:
    """Return a row for each segment: duration, start, end, amplitude, frequency, rise, gain, kind, recording.

    The kind is 0 for a command in V, 1 for a position with the player's loop, 2 for a position of the bench's own
    drive. The recording counts from 1; 0 is a rest between recordings.
    """
    rows: list[tuple[float, ...]] = []
    for number, one in enumerate(recordings, 1):
        kind = 0.0 if not one.is_position else 1.0 if one.gain > 0.0 else 2.0
        for s in one.segments:
            rows.append((s.duration, s.start, s.end, s.amplitude, s.frequency, s.rise, one.gain, kind, float(number)))
        if number < len(recordings):
            after, last = recordings[number], one.segments[-1].end
            same = after.is_position == one.is_position and after.gain == one.gain
            rest = ramp(last, after.segments[0].start, one.rest) if same else hold(last, one.rest)
            rows.append((rest.duration, rest.start, rest.end, 0.0, 0.0, 0.0, one.gain, kind, 0.0))
    return rows
