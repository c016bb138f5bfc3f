"""The answer of a fleet: counts, changes, failures and repeatability, from the results of its rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from pneucli.config.fleet_file import FleetTable
from pneucli.fleet.trends import Trend
from pneucli.quantities import Z95

Result = Mapping[str, Any]


def fleet_answer(
    settings: FleetTable, results: Sequence[Result], trends: Sequence[Trend], done: int, out: str
) -> dict[str, Any]:
    """Return the answer that ``--json`` prints: counts, the rigs that changed, the failures by cause.

    ``done`` is the number of rows that this run processed, ``out`` the store of the results.
    """
    failures = Counter(str(r["cause"]) for r in results if r["failure"] is not None)
    changed = [{"rig": r["rig"], "date": r["date"], "since": r["since"], "changes": r["changes"]}
               for r in results if r["changes"]]  # fmt: skip
    return {
        "schema": "pneucli/fleet/1",
        "fleet": settings.name,
        "rigs": len({r["rig"] for r in results}),
        "rows": len(results),
        "done": done,
        "unchanged": len(results) - done,
        "failed": sum(failures.values()),
        "changed": len({c["rig"] for c in changed}),
        "alarm_rate": settings.alarm_rate,
        "repeatability": repeatability(settings.healthy, results),
        "verdicts": dict(Counter(r["verdict"] for r in results if r["verdict"])),
        "missing": dict(Counter(name for r in results for name in r["missing"]).most_common()),
        "changes": sorted(changed, key=lambda c: -max(one["confidence"] for one in c["changes"])),
        "failures": [{"cause": cause, "rows": n} for cause, n in failures.most_common()],
        "breaks": sum(bool(t.change_points) for t in trends),
        "out": out,
    }


def repeatability(dates: int, results: Sequence[Result]) -> dict[str, Any] | None:
    """Return the relative spread of each parameter between healthy dates, the median over the rigs."""
    last = {r["rig"]: r for r in results if r.get("repeatability")}
    spreads: dict[str, list[float]] = {}
    for r in last.values():
        for name, one in r["repeatability"]["parameters"].items():
            if value := r["parameters"].get(name, {}).get("value"):
                spreads.setdefault(name, []).append(one["value"] / abs(value))
    parameters = {name: round(median(values), 5) for name, values in spreads.items()}
    return {"rigs": len(last), "dates": dates, "parameters": parameters} if last else None


def parameter_records(results: Sequence[Result]) -> Iterator[tuple[str, str, str, str, float, float]]:
    """Yield each parameter of each row: rig, date, name, unit, value, standard error."""
    for r in results:
        for name, p in r["parameters"].items():
            low, high = p["ci95"]
            if None not in (p["value"], low, high):
                yield r["rig"], r["date"], name, p["unit"], p["value"], (high - low) / (2.0 * Z95)
