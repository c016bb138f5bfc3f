"""The experiment that a diagnosis proposes."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.messages.formatting import format_plain


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
