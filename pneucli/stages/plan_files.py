"""The files of a plan: commands, steps for a person, power table, page, and command players."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.export.command_player import PlayedRecording, PlayerLimits, write_players
from pneucli.io.artifacts import Provenance, atomic_path, write_table
from pneucli.messages.plan import plan_sentence, steps_page
from pneucli.pipeline.context import Context
from pneucli.plan.limits import Limits
from pneucli.plan.manoeuvre import Manoeuvre, sample
from pneucli.plan.manoeuvres import CHANGE_OVER_TIME, SPEED_SHARE
from pneucli.plan.power import Power, Prediction
from pneucli.report.plan_page import plan_page
from pneucli.stages.expected_power import Basis

Array = NDArray[np.float64]
COMMAND_PERIOD = 1e-3  # s, between the rows of commands.csv
COMMANDS_FILE, STEPS_FILE, POWER_FILE, PAGE_FILE = "commands.csv", "steps.md", "power.parquet", "plan.html"
COLUMNS = {  # of commands.csv: header, factor from SI, decimals
    "u": ("u [V]", 1.0, 5),
    "u2": ("u2 [V]", 1.0, 5),
    "p_ref": ("p_ref [bar]", 1e-5, 5),
    "x_ref": ("x_ref [mm]", 1e3, 4),
}
TYPES = {"size": np.float64, "power": np.float64, "typical": np.bool_}  # of columns of numbers, also empty ones


def write_plan(
    answer: dict[str, Any],
    programme: Sequence[Manoeuvre],
    predictions: Sequence[Prediction],
    powers: Sequence[Power],
    context: Context,
    basis: Basis,
) -> dict[str, Any]:
    """Write the files of a plan; return its answer with their names.

    Args:
        answer: The answer so far.
        programme: The recordings.
        predictions: Each as the best model predicts it.
        powers: The power table.
        context: The run of the stage.
        basis: What the plan started from.
    """
    out, rows = context.out, answer["recordings"]
    _write_text(out / COMMANDS_FILE, commands_csv(programme, rows))
    answer["sentence"] = plan_sentence(answer)
    _write_text(out / STEPS_FILE, steps_page(answer, context.path.name))
    _write_power(out / POWER_FILE, powers, Provenance({}, {"plan": context.config.document.get("plan", {})}))
    answer["power"] = [power_row(one) for one in powers]
    _write_text(out / PAGE_FILE, plan_page(answer, predictions))
    if targets := {*context.options.get("to", [])} & {"c", "st"}:
        played = [_played(m, row) for m, row in zip(programme, rows, strict=True)]
        write_players(out, targets, played, _player_limits(basis.limits, programme), context.config.name)
    answer["files"] = sorted(path.name for path in out.iterdir() if not path.name.startswith("."))
    answer["folder"] = f"{context.artifacts.parent.name}/{context.artifacts.name}/plan"
    return answer


def _write_text(path: Path, text: str) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def commands_csv(programme: Sequence[Manoeuvre], rows: Sequence[Mapping[str, Any]]) -> str:
    """Return ``commands.csv``: a row each millisecond, the columns that the benches take, the recording's name.

    A column is empty where the bench takes another command. Between recordings the last value is held.
    """
    columns = [name for name in COLUMNS if any(name in _commands(m) for m in programme)]
    lines = [",".join(["time [s]", *(COLUMNS[name][0] for name in columns), "recording"])]
    step = 0
    for m, row in zip(programme, rows, strict=True):
        commands = _commands(m)
        length = next(iter(commands.values())).size
        rest = round(CHANGE_OVER_TIME / COMMAND_PERIOD) if row is not rows[-1] else 0
        for k in range(length + rest):
            cells = [f"{(step + k) * COMMAND_PERIOD:.3f}"]
            for name in columns:
                _, factor, decimals = COLUMNS[name]
                value = commands[name][min(k, length - 1)] * factor if name in commands else None
                cells.append("" if value is None else f"{value:.{decimals}f}".rstrip("0").rstrip("."))
            lines.append(",".join([*cells, row["name"] if k < length else ""]))
        step += length + rest
    return "\n".join(lines) + "\n"


def _commands(manoeuvre: Manoeuvre) -> dict[str, Array]:
    """Return the commands (n,) of a manoeuvre in SI: what its bench takes."""
    bench, values = manoeuvre.bench, sample(manoeuvre.profile, COMMAND_PERIOD)
    found = {bench.quantity: values}
    if bench.drive == "valve" and "u2" in bench.signals:
        found["u2"] = 2.0 * bench.rig.valve_null - values
    if manoeuvre.pressure is not None:
        found["p_ref"] = np.full(values.size, manoeuvre.pressure)
    return found


def _write_power(path: Path, powers: Sequence[Power], provenance: Provenance) -> None:
    columns = {
        f.name: np.array([getattr(one, f.name) for one in powers], dtype=TYPES.get(f.name)) for f in fields(Power)
    }
    units = {"size": "see column unit", "power": "1", "typical": "1"}
    write_table(path, columns, units=units, schema="pneucli/plan/power/1", provenance=provenance)


def power_row(one: Power) -> dict[str, Any]:
    """Return an entry of the power table; a size of None: no size is found."""
    return asdict(one) | {"size": one.size if np.isfinite(one.size) else None}


def _played(manoeuvre: Manoeuvre, row: Mapping[str, Any]) -> PlayedRecording:
    bench = manoeuvre.bench
    return PlayedRecording(
        name=row["name"],
        is_position=bench.quantity == "x_ref",
        gain=bench.gain if bench.drive == "position" else 0.0,
        segments=manoeuvre.profile,
        rest=CHANGE_OVER_TIME,
    )


def _player_limits(limits: Limits, programme: Sequence[Manoeuvre]) -> PlayerLimits:
    benches = [m.bench for m in programme]
    low, high = limits.position
    return PlayerLimits(
        null=benches[0].rig.valve_null,
        command=max(limits.command_range(b) for b in benches),
        position=(low, high) if np.isfinite(low) and np.isfinite(high) else None,
        pressure=limits.max_pressure if np.isfinite(limits.max_pressure) else None,
        soft_start=limits.soft_start,
        max_speed=SPEED_SHARE * limits.max_speed if np.isfinite(limits.max_speed) else None,
        mirrored=any("u2" in b.signals for b in benches),
    )
