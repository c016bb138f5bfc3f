"""The answer of ``simulate``: what the controller holds on the identified model, and where it fails."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from pneucli.figure import optional
from pneucli.messages import StageAnswer, each, labelled, table
from pneucli.messages.formatting import (
    format_bounded,
    format_fit,
    format_number,
    format_plain,
    format_quantity,
    join_names,
)

CHANNEL_TITLES = ("open loop", "channel", "least", "largest", "at the end", "rms error", "fit")
Figures = Mapping[str, float | None]  # of one run, by the names in METRIC_TITLES
METRIC_TITLES = {  # of pneucli.closed_loop.metrics.Metrics, as people read them
    "steady_um": "error at rest, µm",
    "cycle_um": "movement at rest, µm",
    "tracking_rms_um": "error on the way, rms, µm",
    "tracking_max_um": "error on the way, largest, µm",
    "overshoot_um": "overshoot, µm",
    "rise_s": "rise from 10 to 90 %, s",
    "settling_s": "within 50 µm after, s",
    "recovery_s": "load rejected to 50 µm after, s",
    "peak_um": "largest error after a change of load, µm",
    "load_error": "load's estimate off by, share",
    "switching_hz": "reversals of the command, 1/s",
    "fast_share": "command above 50 Hz, share",
    "fast_v": "command above 50 Hz, rms, V",
    "air_kg": "air drawn, kg",
    "pressure_rest_pa": "error of the pressure at rest, Pa",
    "pressure_rms_pa": "error of the pressure, rms, Pa",
    "pressure_settling_s": "settling time of the pressure to 2 %, s",
    "sliding_load": "share of samples in sliding, load observer",
    "sliding_flow": "share of samples in sliding, flow observer",
}
MAX_NAMED_EFFECTS = 3  # effects that are named where a check does not always hold


@dataclass(frozen=True)
class SimulatedChannel:
    """Lowest, highest and last value of a channel in its ``unit``, and its error where it was measured."""

    channel: str
    unit: str
    from_: float
    to: float
    end: float
    rmsd: float | None
    fit_percent: float | None

    @property
    def row(self) -> tuple[str, ...]:
        """The row of a table under ``CHANNEL_TITLES``, without the scenario."""
        sizes = (format_quantity(one, self.unit, 3) for one in (self.from_, self.to, self.end, self.rmsd))
        return self.channel, *sizes, format_fit(self.fit_percent)


@dataclass(frozen=True)
class OpenLoop:
    """An open-loop scenario."""

    scenario: str
    channels: Sequence[SimulatedChannel]

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The rows of a table under ``CHANNEL_TITLES``."""
        return [(self.scenario, *one.row) for one in self.channels]


@dataclass(frozen=True)
class SuccessRate:
    """Runs with one effect ("": none, "all": any) in which a check passed, and the worst of them."""

    check: str
    limit: float
    effect: str
    held: int
    runs: int
    worst: float | None
    worst_run: int

    @property
    def share(self) -> float:
        """The share of runs in which the check passed."""
        return self.held / self.runs


@dataclass(frozen=True)
class CheckRate:
    """Runs in which a check passed, of all."""

    limit: float
    held: int
    runs: int
    share: float
    worst: float | None
    worst_run: int


@dataclass(frozen=True)
class Robustness:
    """A Monte Carlo study: its checks over all runs, and by effect."""

    runs: int
    seed: int
    checks: Mapping[str, CheckRate]
    by_effect: Sequence[SuccessRate]

    def harmful(self, check: str) -> list[str]:
        """Return the effects with which most runs fail a check, worst first."""
        mine = [r for r in self.by_effect if r.check == check and r.effect not in ("", "all") and r.held < r.runs]
        return [r.effect for r in sorted(mine, key=lambda r: r.share)[:MAX_NAMED_EFFECTS]]


@dataclass(frozen=True)
class ReplayCheck:
    """The largest difference in V of a command of the C from the simulation; None with the reason without one."""

    difference_v: float | None
    samples: int = 0
    reason: str = ""


@dataclass(frozen=True)
class Answer(StageAnswer):
    """Open-loop scenarios, and where a controller was designed the figures of closed-loop ones by scenario."""

    open_loop: Sequence[OpenLoop]
    closed_loop: Mapping[str, Figures] | None = optional()
    pid_alone: Mapping[str, Figures] | None = optional()
    tolerance_um: float | None = optional()
    exported_c: ReplayCheck | None = optional()
    robust: Robustness | None = optional()

    def lines(self, file: str, verbose: bool) -> Iterator[str]:
        """Yield what is held and where it fails; behind ``-v`` the figures of every scenario."""
        if self.closed_loop is not None:
            yield from labelled("holds", self.performance)
            yield from each("fails", self.failures)
        else:
            yield from labelled("found", f"{len(self.open_loop)} open-loop scenarios; no controller was designed")
        if verbose:
            yield from table(CHANNEL_TITLES, [row for one in self.open_loop for row in one.rows], texts=2)
            yield from self._closed_loop()
        yield from labelled("do", f"pneucli report {file}")

    @property
    def performance(self) -> str:
        """The worst figures of the closed loop in one line."""
        return ", ".join(self.worst_metrics) or "nothing that the scenarios measure"

    @property
    def worst_metrics(self) -> list[str]:
        """The worst figures of the closed loop: at rest, on the way, under load."""
        worst = {name: max(of, key=lambda one: one[0]) for name in METRIC_TITLES if (of := self._known(name))}
        parts = []
        if "steady_um" in worst:
            tolerance = f" (tolerance {format_number(self.tolerance_um, 2)} µm)" if self.tolerance_um else ""
            parts.append(f"{format_number(worst['steady_um'][0], 2)} µm at rest{tolerance}")
        if "tracking_rms_um" in worst:
            value, scenario = worst["tracking_rms_um"]
            parts.append(f"{format_number(value, 2)} µm rms on the way ({scenario})")
        if "recovery_s" in worst:
            parts.append(f"a load is rejected to 50 µm in {format_number(worst['recovery_s'][0], 2)} s")
        return parts

    def _known(self, figure: str) -> list[tuple[float, str]]:
        values = ((figures.get(figure), name) for name, figures in (self.closed_loop or {}).items())
        return [(value, name) for value, name in values if value is not None]

    @property
    def failures(self) -> list[str]:
        """The scenarios that miss the tolerance, and how often each check of the Monte Carlo study fails."""
        parts = [f"scenario {join_names(self.failed_scenarios)}"] if self.failed_scenarios else []
        for name, check in self.robust.checks.items() if self.robust else ():
            if self.robust and check.held < check.runs:
                limit = f"{METRIC_TITLES.get(name, name)} ≤ {format_plain(check.limit)}"
                count = f"missed in {check.runs - check.held} of {check.runs} runs with an effect outside its model"
                parts.append(f"{limit}: {count}, most with {join_names(self.robust.harmful(name))}")
        return parts

    @property
    def failed_scenarios(self) -> list[str]:
        """The scenarios that end beyond the tolerance, or never come back from a load."""
        tolerance = self.tolerance_um or math.inf
        return [name for name, figures in (self.closed_loop or {}).items() if _misses(figures, tolerance)]

    @property
    def harmful_effects(self) -> list[str]:
        """The effects that make the controller miss most checks because its model lacks them, worst first."""
        worst = [name for check in self.robust.checks for name in self.robust.harmful(check)] if self.robust else []
        return sorted(dict.fromkeys(worst), key=lambda name: -worst.count(name))[:MAX_NAMED_EFFECTS]

    def _closed_loop(self) -> Iterator[str]:
        for name, figures in (self.closed_loop or {}).items():
            pid = (self.pid_alone or {})[name]
            known = {n: v for n, v in figures.items() if v is not None}
            rows = [(METRIC_TITLES.get(n, n), *map(format_bounded, (v, pid[n]))) for n, v in known.items()]
            yield ""
            yield from table((f"closed loop, {name}", "with compensation", "PIDs only"), rows, texts=1)


def _misses(figures: Figures, tolerance: float) -> bool:
    """Whether a scenario ends beyond the tolerance, or never comes back from a load."""
    at_rest = max(figures.get("steady_um") or 0.0, figures.get("cycle_um") or 0.0)
    return at_rest > tolerance or (figures.get("peak_um") is not None and figures.get("recovery_s") is None)
