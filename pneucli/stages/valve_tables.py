"""The valve's identification as artifacts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pneucli.identify.valve import ValveIdentification
from pneucli.io.artifacts import Provenance, write_table

Row = tuple[str, float, str, float, float]


def write_valve(valve: ValveIdentification, out: Path, provenance: Provenance) -> None:
    """Write map, inverse, areas and curves of a valve (interface, section 4)."""
    grid = valve.map
    u, p = np.meshgrid(grid.u, grid.p, indexing="ij")
    write_table(
        out / "valve_map.parquet",
        {
            "u": u.ravel(),
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
            "u": inverse.u.ravel(),
            "reachable": inverse.reachable.ravel(),
        },
        units={"p_gradient": "Pa/s", "p": "Pa", "u": "V", "reachable": "1"},
        schema="pneucli/identify/valve_inverse/1",
        provenance=provenance,
    )
    _write_commands(valve, out, provenance)
    _write_curves(valve, out, provenance)


def _write_commands(valve: ValveIdentification, out: Path, provenance: Provenance) -> None:
    areas = [c.area for c in valve.commands]
    unit = "m^2" if valve.volume is not None else "1/m"
    write_table(
        out / "valve_areas.parquet",
        {
            "u": np.array([c.u for c in valve.commands]),
            "area": np.array([a.value for a in areas]),
            "ci_low": np.array([a.ci_low for a in areas]),
            "ci_high": np.array([a.ci_high for a in areas]),
        },
        units={"u": "V"} | dict.fromkeys(("area", "ci_low", "ci_high"), unit),
        schema="pneucli/identify/valve_areas/1",
        provenance=provenance,
    )


def _write_curves(valve: ValveIdentification, out: Path, provenance: Provenance) -> None:
    columns = ("time", "measured", "fitted", "gradient", "ci_low", "ci_high")
    table = {name: np.concatenate([getattr(c, name) for c in valve.curves]) for name in columns}
    sizes = [c.time.size for c in valve.curves]
    write_table(
        out / "valve_curves.parquet",
        {
            "recording": [c.recording for c, n in zip(valve.curves, sizes, strict=True) for _ in range(n)],
            "u": np.repeat([c.u for c in valve.curves], sizes),
            **table,
        },
        units={"u": "V", "time": "s", "measured": "Pa", "fitted": "Pa"}
        | dict.fromkeys(("gradient", "ci_low", "ci_high"), "Pa/s"),
        schema="pneucli/identify/valve_curves/1",
        provenance=provenance,
    )


def iso_parameters(valve: ValveIdentification) -> list[Row]:
    """Return ISO 6358-1 characteristics by command: name, value, unit, and the interval of twice the uncertainty."""
    rows: list[Row] = []
    names = {"C": ("sonic_conductance", "m^3/(s Pa)"), "b": ("critical_ratio", "1"), "m": ("subsonic_index", "1")}
    for one in valve.iso:
        for letter, (name, unit) in names.items():
            e = getattr(one, letter)
            low, high = e.value - 2 * e.uncertainty, e.value + 2 * e.uncertainty
            rows.append((f"valve.{name}({one.u:+.4g} V)", e.value, unit, low, high))
    return rows
