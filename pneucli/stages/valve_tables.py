"""The valve's identification as artifacts, as answer, and as warnings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.identify.fit import Estimate
from pneucli.identify.valve import IsoConductance, LackOfFit, ValveIdentification
from pneucli.identify.valve.iso import Figure
from pneucli.identify.valve.maps import Z95
from pneucli.io.artifacts import Provenance, write_table
from pneucli.simulate.model import Model
from pneucli.simulate.valve_area import area_name
from pneucli.words.numbers import percent, quantity, times

Row = tuple[str, float, str, float, float]
FOLLOWED = 3.0  # times the noise: more on curves than a good map leaves
FORESEEN = 2.0  # times what it leaves on the curves that were fitted


def write_valve(
    valve: ValveIdentification, model: Model, estimates: Sequence[Estimate], out: Path, provenance: Provenance
) -> None:
    """Write map, inverse, lack of fit, the model's areas, and curves of a valve (interface, section 4).

    Commands are those that went to the valve: the null one is added.
    """
    grid, null = valve.map, model.rig.valve_null
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    write_table(
        out / "valve_map.parquet",
        {
            "u": null + u.ravel(),
            "p": p.ravel(),
            "p_gradient": grid.gradient.ravel(),
            "p_gradient_ci_low": grid.ci_low.ravel(),
            "p_gradient_ci_high": grid.ci_high.ravel(),
            "covered": grid.covered.ravel(),
        },
        units={"u": "V", "p": "Pa", "covered": "1"}
        | dict.fromkeys(("p_gradient", "p_gradient_ci_low", "p_gradient_ci_high"), "Pa/s"),
        schema="pneucli/identify/valve_map/1",
        provenance=provenance,
    )
    inverse = valve.inverse
    gradient, p = np.meshgrid(inverse.p_gradient, inverse.p, indexing="ij")
    write_table(
        out / "valve_inverse.parquet",
        {
            "p_gradient": gradient.ravel(),
            "p": p.ravel(),
            "u": null + inverse.u.ravel(),
            "reachable": inverse.reachable.ravel(),
        },
        units={"p_gradient": "Pa/s", "p": "Pa", "u": "V", "reachable": "1"},
        schema="pneucli/identify/valve_inverse/1",
        provenance=provenance,
    )
    _write_lack(valve, null, out, provenance)
    _write_areas(model, estimates, out, provenance)
    _write_curves(valve, null, out, provenance)


def _write_lack(valve: ValveIdentification, null: float, out: Path, provenance: Provenance) -> None:
    """Write the model's valve beside the measured map, at its points where data covered it."""
    grid, lack = valve.map, valve.lack
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    columns = {
        "model": lack.model,
        "model_ci_low": lack.model - Z95 * lack.error,
        "model_ci_high": lack.model + Z95 * lack.error,
        "measured": grid.gradient,
        "measured_ci_low": grid.ci_low,
        "measured_ci_high": grid.ci_high,
        "difference": lack.difference,
    }
    table = {"u": null + u, "p": p, **columns, "outside": lack.outside}
    write_table(
        out / "valve_lack_of_fit.parquet",
        {name: values[grid.covered] for name, values in table.items()},
        units={"u": "V", "p": "Pa", "outside": "1"} | dict.fromkeys(columns, "Pa/s"),
        schema="pneucli/identify/valve_lack_of_fit/1",
        provenance=provenance,
    )


def _write_areas(model: Model, estimates: Sequence[Estimate], out: Path, provenance: Provenance) -> None:
    """Write the effective areas of the model's valve."""
    found = {e.name: e for e in estimates}
    areas = [(c, found[area_name(c)]) for c in model.valve.commands if area_name(c) in found]
    write_table(
        out / "valve_areas.parquet",
        {
            "u": model.rig.valve_null + np.array([c for c, _ in areas]),
            "area": np.array([e.value for _, e in areas]),
            "ci_low": np.array([e.ci95[0] for _, e in areas]),
            "ci_high": np.array([e.ci95[1] for _, e in areas]),
        },
        units={"u": "V"} | dict.fromkeys(("area", "ci_low", "ci_high"), areas[0][1].unit if areas else "m^2"),
        schema="pneucli/identify/valve_areas/1",
        provenance=provenance,
    )


def _write_curves(valve: ValveIdentification, null: float, out: Path, provenance: Provenance) -> None:
    columns = ("time", "measured", "fitted", "gradient", "ci_low", "ci_high")
    table = {name: np.concatenate([getattr(c, name) for c in valve.curves]) for name in columns}
    sizes = [c.time.size for c in valve.curves]
    write_table(
        out / "valve_curves.parquet",
        {
            "recording": [c.recording for c, n in zip(valve.curves, sizes, strict=True) for _ in range(n)],
            "u": null + np.repeat([c.u for c in valve.curves], sizes),
            **table,
        },
        units={"u": "V", "time": "s", "measured": "Pa", "fitted": "Pa"}
        | dict.fromkeys(("gradient", "ci_low", "ci_high"), "Pa/s"),
        schema="pneucli/identify/valve_curves/1",
        provenance=provenance,
    )


def iso_parameters(valve: ValveIdentification) -> list[Row]:
    """Return ISO 6358-1 characteristics by command: name, value, unit, 95 % interval; and what the curves show."""
    rows: list[Row] = []
    names = {"C": ("sonic_conductance", "m^3/(s Pa)"), "b": ("critical_ratio", "1"), "m": ("subsonic_index", "1")}
    for one in valve.iso:
        for letter, (name, unit) in names.items():
            figure: Figure = getattr(one, letter)
            rows.append((f"valve.{name}({one.u:+.4g} V)", figure.value, unit, figure.low, figure.high))
            if figure.seen is not None:
                value, low, high = figure.seen
                rows.append((f"valve.{name}_of_curve({one.u:+.4g} V)", value, unit, low, high))
    return rows


def valve_answer(valve: ValveIdentification, estimates: Sequence[Estimate]) -> dict[str, Any]:
    """Return what ``identify --json`` says of the valve."""
    found = {e.name: e for e in estimates}
    sides = {"charge": "valve.overlap_fill", "discharge": "valve.overlap_vent"}
    overlap = {side: found[name] for side, name in sides.items() if name in found}
    lack = valve.lack
    return {
        "overlap": {k: {"value": e.value, "unit": e.unit, "ci95": list(e.ci95)} for k, e in overlap.items()},
        "iso": {n: {"value": v, "unit": u, "ci95": [low, high]} for n, v, u, low, high in iso_parameters(valve)},
        "lack_of_fit": {"median": lack.median, "p95": lack.p95, "share_outside": lack.share_outside},
        "residual": {
            "train": valve.over_noise("train"),
            "test": valve.over_noise("test"),
            "recordings": [asdict(one) for one in valve.residuals],
        },
    }


def valve_warnings(valve: ValveIdentification) -> Iterator[str]:
    """Yield what people must know before they use the map or the model of the valve."""
    if not valve.described:
        yield (
            f"valve-not-described: the map of the valve reaches {quantity(valve.steepest, 'Pa/s')}, its curves show no "
            f"more than {quantity(valve.shown, 'Pa/s')}; do not use it, and see what ingest finds implausible"
        )
    train, test = valve.over_noise("train") or 0.0, valve.over_noise("test") or 0.0
    if train > FOLLOWED:
        yield (
            f"valve-curves-not-followed: the map leaves {times(train)} × noise on its own curves; no gradient over "
            "command and pressure can: heat, a lag, play or a supply that gives way, which the model lacks, or a "
            "vessel that is full within some samples"
        )
    if test > max(FOLLOWED, FORESEEN * train):
        yield (
            f"valve-not-foreseen: the map leaves {times(test)} × noise on held-out curves; take commands between those "
            "that were fitted, or record more of them"
        )
    yield from _lack_warning(valve.lack)
    yield from _ratio_warning([one for one in valve.iso if one.b.contradicted], len(valve.iso))


def _lack_warning(lack: LackOfFit) -> Iterator[str]:
    if lack.noticeable:
        median, p95, outside = (percent(n or 0.0) for n in (lack.median, lack.p95, lack.share_outside))
        yield (
            f"valve-lack-of-fit: the model's valve is off the measured map by {median} in the median, {p95} at the "
            f"95th percentile, outside both 95 % intervals at {outside} of the points: pneucli diagnose says what it "
            "may lack"
        )


def _ratio_warning(others: Sequence[IsoConductance], commands: int) -> Iterator[str]:
    if others:
        one = max(others, key=lambda i: abs((i.b.seen or (i.b.value,))[0] - i.b.value))
        value, low, high = one.b.seen or (one.b.value, one.b.low, one.b.high)
        yield (
            f"valve-critical-ratio: at {len(others)} of {commands} commands the curve shows another critical ratio "
            f"than the model has, {one.b.value:.3g}; most at {one.u:+.4g} V: {value:.3g} ({low:.3g} to {high:.3g})"
        )
