"""The export's files: C with its test vectors, MATLAB and CSV."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from pneucli.design import layout
from pneucli.design.closed_loop import Bench, Run, Scenario, run
from pneucli.design.controller import Controller
from pneucli.design.scenarios import start_at
from pneucli.export import c
from pneucli.io.artifacts import atomic_path
from pneucli.simulate.model import Model

Array = NDArray[np.float64]
Table = Mapping[str, NDArray[Any] | list[str]]
REPLAY = "pneucli_replay.csv"
COLUMNS = ("x_ref", "x", "p1", "p2", "u1", "u2")
REPLAY_S = 60.0


def replay_scenario(controller: Controller) -> Scenario:
    """Return a minute that passes through every branch: rest, steps, a sine, loads, drop-outs, what is out of reach."""
    v = controller.values
    time = np.arange(0.0, REPLAY_S, controller.period)
    centre, amplitude = 0.5 * v["C_STROKE"], 0.15 * v["C_STROKE"]
    steps = amplitude * np.sign(np.sin(2 * np.pi * time / 7.0)) * (time > 1.0)
    sine = amplitude * np.sin(2 * np.pi * 0.5 * time)
    out_of_reach = np.where((time > 50.0) & (time < 53.0), 0.98 * v["C_STROKE"] - centre, 0.0)
    offset = np.where(time < 21.0, steps, np.where(time < 40.0, sine, out_of_reach))
    push = 0.1 * v["C_AREA_1"] * (v["C_SUPPLY"] - v["C_AMBIENT"])
    force = push * (np.sign(np.sin(2 * np.pi * time / 11.0)) * ((time > 41.0) & (time < 49.0)) - (time > 55.0))
    lost = (("p1", 9.0, 9.05), ("x", 16.0, 16.02), ("p2", 25.0, 30.0), ("x", 58.0, 58.3))
    supply = np.full(time.size, v["C_SUPPLY"])
    return Scenario("replay", centre + offset, force, supply, start_at(v, centre), lost)


def test_vectors(result: Run) -> dict[str, Array]:
    """Return what the controller read and answered, by the columns of the replay file, each of shape ``(n,)``."""
    places = (layout.L_READ_X, layout.L_READ_P1, layout.L_READ_P2, layout.L_U1, layout.L_U2)
    logged = dict(zip(COLUMNS[1:], result.log[:, places].T, strict=True))
    return {"x_ref": result.scenario.reference, **logged}


def write_c(folder: Path, controller: Controller, model: Model, bench: Bench, pipeline: str) -> None:
    """Write header, source, test vectors and the program that replays them."""
    _write(folder / f"{c.NAME}.h", c.header(controller, pipeline))
    _write(folder / f"{c.NAME}.c", c.source(controller, pipeline))
    _write(folder / c.REPLAY, c.replay_program())
    write_csv(folder / REPLAY, test_vectors(run(model, controller, replay_scenario(controller), bench)))


def write_csv(path: Path, table: Table) -> None:
    """Write columns with a header line; numbers so that they are read back to the last bit."""
    text = io.StringIO()
    text.write(",".join(table) + "\n")
    for row in zip(*(list(column) for column in table.values()), strict=True):
        text.write(",".join(v if isinstance(v, str) else repr(float(v)) for v in row) + "\n")
    _write(path, text.getvalue())


def write_mat(path: Path, controller: Controller, tables: Mapping[str, Table]) -> None:
    """Write a MATLAB file (v5): the controller's numbers and inverse tables, and each table as a struct of columns."""
    numbers = {name.removeprefix("C_").lower(): value for name, value in controller.values.items()}
    content: dict[str, Any] = {
        "controller": {**numbers, **{name: np.array(table) for name, table in controller.tables().items()}}
    }
    for name, table in tables.items():
        content[name] = {k: np.array(v, dtype=object) if isinstance(v, list) else v for k, v in table.items()}
    with atomic_path(path) as temporary:
        savemat(temporary, content, long_field_names=True, oned_as="column")


def controller_table(controller: Controller) -> dict[str, NDArray[Any] | list[str]]:
    """Return the controller's numbers as a table of name and value."""
    names = [name for name in layout.PARAMETERS if name in controller.values]
    return {"name": names, "value": np.array([controller.values[name] for name in names])}


def inverse_table(controller: Controller) -> dict[str, NDArray[Any] | list[str]]:
    """Return the valve's inverse: effective area (m^2, vented ones negative) and the command in V that opens it.

    Where a second valve drives chamber 2 its inverse follows, and a column tells the ``chamber``.
    """
    values, share = controller.values, np.linspace(0.0, 1.0, len(controller.fill)) ** 2
    sides = [("C_AREA_VENT", "C_AREA_FILL", controller.vent, controller.fill)]
    if values["C_TWO_VALVES"] > 0.5:
        sides.append(("C_AREA_VENT_2", "C_AREA_FILL_2", controller.vent_2, controller.fill_2))
    areas = [np.concatenate([-share[::-1] * values[vent], share * values[fill]]) for vent, fill, _, _ in sides]
    table = {"area": np.concatenate(areas), "u": np.concatenate([[*vent[::-1], *fill] for _, _, vent, fill in sides])}
    chamber = {"chamber": np.repeat([1.0, 2.0], 2 * share.size)} if len(sides) > 1 else {}
    return {**chamber, **table}


def _write(path: Path, text: str) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
