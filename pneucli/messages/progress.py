"""What a stage will do, what it is doing, and how long that takes."""

from collections.abc import Sequence

from pneucli.messages.formatting import format_plain

LOG_INTERVAL_VARIABLE = "PNEUCLI_LOG_INTERVAL"  # of the environment: s, between two lines of progress in a log
NO_ESTIMATE = "no estimate yet"
GIVEN_MODEL_PROGRESS = "fitting the given model"
FREE_RUN_PROGRESS = "comparing the free run"
BASELINE_PROGRESS = "fitting all recordings"


def starting(stage: str, reasons: Sequence[str], work: str | None, seconds: float | None) -> str:
    """Return that a stage begins: why, what it has before it where that is known, and about how long it takes.

    >>> starting("compare", ["first time"], "6 recordings, 48,000 samples", 12.3)
    'running compare (first time): 6 recordings, 48,000 samples; about 12 s'
    >>> starting("compare", ["first time"], "6 recordings", None)
    'running compare (first time): 6 recordings; no estimate yet'
    """
    text = f"running {stage} ({', '.join(reasons)})"
    if work is None:
        return text
    return f"{text}: {'; '.join(filter(None, [work, NO_ESTIMATE if seconds is None else f'about {rough(seconds)}']))}"


def progress_line(message: str, elapsed: float, left: float | None) -> str:
    """Return what is being done, for how long by now, and about how long it still takes.

    Args:
        message: What is being done.
        elapsed: Seconds since the work began.
        left: Seconds until it ends; below 0 where it should have ended, None where nothing tells.

    >>> progress_line("fitting stribeck", 94.2, 130.0)
    '  fitting stribeck (1 min 34 s, about 2 min left)'
    """
    minutes, seconds = divmod(int(elapsed), 60)
    so_far = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
    if left is None:
        return f"  {message} ({so_far}, {NO_ESTIMATE})"
    rest = f"about {rough(left)} left" if left > 0.0 else "longer than estimated"
    return f"  {message} ({so_far}, {rest})"


def rough(seconds: float) -> str:
    """Return a time that is known roughly, in seconds, minutes or hours.

    >>> rough(0.2), rough(48.3), rough(95), rough(7000)
    ('1 s', '48 s', '2 min', '1.9 h')
    """
    if seconds < 90.0:
        return f"{max(1, round(seconds))} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{format_plain(seconds / 3600.0, 2)} h"


def counted(action: str, number: int, total: int) -> str:
    """Return what is being done, to which of how many, from 0 on: ``"smoothing run-3, 3 of 6"``."""
    return f"{action}, {number + 1} of {total}"


def screening_progress(effect: str, remaining: int) -> str:
    """Return that the score test of an effect runs, and how many effects remain."""
    return f"screening {effect}, {remaining} left"


def fitting_progress(effect: str) -> str:
    """Return that a fit with an effect runs."""
    return f"fitting {effect}"


def fitted_progress(effect: str) -> str:
    """Return that a worker has finished a fit with an effect."""
    return f"fitted {effect}"
