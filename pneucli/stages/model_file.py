"""The identified model as a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pneucli.io.artifacts import Tables, read_table
from pneucli.physics.declaration import Effect
from pneucli.recording import Rig
from pneucli.simulate.model import Model, ValveForm, with_parameters
from pneucli.simulate.valve_forms import LinearValve, SwitchingValve, ValveArea

MODEL_FILE = "model.parquet"
DRAWS_FILE = "parameter_draws.parquet"


def save_model(model: Model, tables: Tables) -> None:
    """Write a model's values and its valve."""
    rows = [("value", name, np.nan, value) for name, value in model.values.items()]
    rows += [row for valve in model.valves for row in _valve_rows(valve)]
    tables.write("model", "kind, name, command [V], value [SI]", rows)


def _valve_rows(valve: ValveForm) -> list[tuple[str, str, float, float]]:
    """Return a valve's rows: kind, name, command, value; the name begins with its label."""
    name = valve.label
    if isinstance(valve, LinearValve):
        return [("gain", name, valve.max_command, valve.gain)]
    if isinstance(valve, SwitchingValve):
        return [("switching", name, valve.max_command, valve.fill), ("switching", name, -valve.max_command, valve.vent)]
    overlaps = ((1.0, valve.overlap_fill), (-1.0, valve.overlap_vent))
    rows = [("area", name, c, a) for c, a in zip(valve.commands, valve.areas, strict=True)]
    return rows + [("overlap", name, sign, value) for sign, value in overlaps]


def _valve_from_rows(rows: list[tuple[str, float, float]], label: str) -> ValveForm:
    """Return the valve whose rows (kind, command, value) these are."""
    by_kind: dict[str, list[tuple[float, float]]] = {}
    for kind, command, value in rows:
        by_kind.setdefault(kind, []).append((command, value))
    if "gain" in by_kind:
        (largest, gain), *_ = by_kind["gain"]
        return LinearValve(gain, largest, label)
    if "switching" in by_kind:
        (largest, fill), (_, vent) = by_kind["switching"]
        return SwitchingValve(fill, vent, largest, label)
    knots, overlap = by_kind.get("area", []), dict(by_kind["overlap"])
    return ValveArea(tuple(c for c, _ in knots), tuple(a for _, a in knots), overlap[1.0], overlap[-1.0], label=label)


def load_model(folder: Path, rig: Rig, effects: tuple[Effect, ...]) -> Model:
    """Return the model that ``identify`` wrote."""
    table = read_table(folder / MODEL_FILE)
    rows = [
        (str(k), str(n), float(c), float(v))
        for k, n, c, v in zip(table["kind"], table["name"], table["command"], table["value"], strict=True)
    ]
    values = {n: v for k, n, _, v in rows if k == "value"}
    valves = {
        label: [(k, c, v) for k, n, c, v in rows if k != "value" and n == label] for label in ("valve", "valve_2")
    }
    second = _valve_from_rows(valves["valve_2"], "valve_2") if valves["valve_2"] else None
    return Model(rig, effects, values, _valve_from_rows(valves["valve"], "valve"), second)


def save_drawn_parameters(drawn: Sequence[Mapping[str, float]], tables: Tables) -> None:
    """Write parameters that the recordings allow as well, a row for each draw and parameter."""
    rows = [(i, name, value) for i, values in enumerate(drawn) for name, value in values.items()]
    tables.write("parameter_draws", "draw [1], name, value [SI]", rows)


def load_drawn_models(folder: Path, model: Model) -> list[Model]:
    """Return the identified model with each of the drawn sets of parameters that ``identify`` wrote."""
    table = read_table(folder / DRAWS_FILE)
    drawn: dict[int, dict[str, float]] = {}
    for draw, name, value in zip(table["draw"], table["name"], table["value"], strict=True):
        drawn.setdefault(int(draw), {})[str(name)] = float(value)
    return [with_parameters(model, values) for values in drawn.values()]


def parameter_intervals(artifacts: Path) -> dict[str, tuple[float, float]]:
    """Return the 95 % intervals of the identified parameters."""
    table = read_table(artifacts / "identify" / "parameters.parquet")
    rows = zip(table["name"], table["ci_low"], table["ci_high"], strict=True)
    return {str(name): (float(low), float(high)) for name, low, high in rows}
