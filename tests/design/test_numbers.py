"""The numbers of a controller, as stored, and how each situation of axis, effects and requirements changes them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.physics.effects import catalogue
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import ValveArea
from tests.design import axis
from tests.stored import hold_rows_against

STORED = Path(__file__).parent / "stored" / "numbers.json"


def model_of(row: dict[str, Any]) -> Model:
    """The axis with the effects, parameters, rig and valve of a row."""
    base, values = axis.model(), row.get("values", {})
    names = {name.partition(".")[0] for name in values} | {e.name for e in base.effects}
    effects = tuple(catalogue()[name] for name in sorted(names & catalogue().keys() - set(row.get("without", ()))))
    rig = replace(axis.RIG, **row.get("rig", {}))
    valve = ValveArea(*(tuple(part) for part in row["valve"])) if "valve" in row else base.valve
    return replace(base, rig=rig, valve=valve, effects=effects).with_values(values)


def told(row: dict[str, Any]) -> dict[str, float]:
    """All numbers of its controller, of tables a few, and the corners of loops that predict or do not."""
    model, wanted = model_of(row), replace(axis.REQUIREMENTS, **row.get("requirements", {}))
    made: Controller = design_cascade(model, wanted, row.get("sealed", axis.SEALED))
    found = dict(made.values)
    for name, table in made.tables().items():
        found |= {f"{name} mean": np.mean(table), f"{name} end": table[-1], f"{name} way": np.abs(np.diff(table)).sum()}
    for predicted in (True, False):
        corners = vars(choose_bandwidths(model, wanted, made.values, predicted=predicted))
        found |= {f"{name}{'' if predicted else ', unpredicted'}": corner for name, corner in corners.items()}
    return {name: float(f"{round(float(one), 15):.6g}") for name, one in found.items()}


def test_the_numbers_of_each_situation_are_as_stored() -> None:
    usual = told({})

    def gives(row: dict[str, Any]) -> dict[str, float]:
        found = told(row)
        return {name: one for name, one in found.items() if one != usual[name] or row.keys() <= {"gives"}}

    hold_rows_against(STORED, gives, rel=1e-4)


def test_each_row_changes_what_a_controller_is_given() -> None:
    rows = json.loads(STORED.read_text(encoding="utf-8"))
    assert all(row["gives"] for row in rows)
