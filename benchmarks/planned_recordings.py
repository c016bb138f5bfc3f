"""Carry out a plan on a virtual rig: its commands as excitations of the rig that recorded the case.

A plan is what ``pneucli plan`` writes: ``commands.csv``, and of its JSON answer the list ``recordings``. Nothing of the
program is imported.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import closed_loop
from pneucli.exam.rig.imposed_motion import MotionMachine
from pneucli.exam.rig.kernel import Array
from pneucli.exam.rig.parameters import FIVE_THREE, Parameters
from pneucli.exam.rig.simulation import Excitation

FACTORS = {"u [V]": 1.0, "u2 [V]": 1.0, "p_ref [bar]": 1e5, "x_ref [mm]": 1e-3}
DRIVE_GAIN = 600.0  # V/m, of the own drive of a bench that follows a position, on the usual rig (0.2 m, 10 V)
Commands = dict[str, dict[str, Array]]


def read_commands(path: Path) -> Commands:
    """Return the commands of each recording by column, SI, each (n,) with a value each ms."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    names = [name for name in dict.fromkeys(row["recording"] for row in rows) if name]
    return {name: _columns([row for row in rows if row["recording"] == name]) for name in names}


def _columns(rows: Sequence[Mapping[str, str]]) -> dict[str, Array]:
    return {
        header.partition(" ")[0]: factor * np.array([float(row[header]) for row in rows])
        for header, factor in FACTORS.items()
        if rows[0].get(header)
    }


def planned_recordings(
    laboratory: Laboratory, planned: Sequence[Mapping[str, Any]], commands: Commands, load: float = 0.0
) -> list[RecordingPlan]:
    """Return the recordings of a plan on the rig of a laboratory.

    Args:
        laboratory: The laboratory with the hidden rig.
        planned: The entries ``recordings`` of the plan's answer; of those by hand a weight is hung on the piston, and a
            valve that a person shuts is left out.
        commands: The commands of each, as :func:`read_commands` returns them.
        load: Stated force in N toward x = 0 that p1 carries at the start.
    """
    return [
        RecordingPlan(
            one["name"],
            one["experiment"],
            one["use"],
            excitation(laboratory, one, commands[one["name"]], load - one["force"]),
            one["chamber"],
            one["force"],
        )
        for one in planned
        if one["force"] or not one["by_hand"]
    ]


def excitation(
    laboratory: Laboratory, planned: Mapping[str, Any], commands: Mapping[str, Array], load: float
) -> Excitation | MotionMachine:
    """Return the excitation of one recording of a plan.

    Args:
        laboratory: The laboratory with the hidden rig.
        planned: The entry of the plan.
        commands: Its commands.
        load: Stated force in N toward x = 0.
    """
    par = laboratory.parameters
    if planned["experiment"] == "valve":
        bench = laboratory.valve_test_rig_of(planned["chamber"])
        opening = bench.command_sign * (commands["u"] - par.command_null)
        return Excitation(opening, pressure_1=par.ambient, pressure_2=par.ambient)
    if planned["drive"] == "machine":
        return _machine_strokes(commands["x_ref"], float(commands["p_ref"][0]), planned["speed"])
    start, is_open = planned["start"], planned["chamber_2"] == "open"
    gauge = float(start["p1"]) - par.ambient
    if planned["drive"] == "valve":
        at_rest = closed_loop(par, np.full(1, float(start["x"])), 0.0, gauge, load)
        return replace(at_rest, command=commands["u"] - par.command_null, chamber_2_open=is_open)
    gain = planned["gain"] if planned["drive"] == "position" else drive_gain(par)
    return replace(closed_loop(par, commands["x_ref"], gain, gauge, load), chamber_2_open=is_open)


def drive_gain(par: Parameters) -> float:
    """Return the gain in V/m of a bench's own drive; half where the valve drives both chambers."""
    shared = 0.5 if par.arrangement == FIVE_THREE else 1.0
    return shared * DRIVE_GAIN * (par.command_range / 10.0) * (0.2 / par.stroke)


def _machine_strokes(reference: Array, pressure: float, speed: float) -> MotionMachine:
    """Return the strokes of a machine between the extremes of a reference (m)."""
    low, high = float(reference.min()), float(reference.max())
    return MotionMachine((low, high), (speed,), 4, pressure)
