"""What benchmarks share, and small inputs with which ``python -m benchmarks.NAME --small`` runs to its end in seconds.

So small a run measures nothing; it shows that a benchmark still runs. A pipeline that a benchmark otherwise identifies
is replaced by the exact model of the exam's rig.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from benchmarks.rigs import model_of
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.config import load
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.exam.cases import generate_case, prepare_case, seal
from pneucli.exam.conditions import parse
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.parameters import ONE_CHAMBER
from pneucli.export.export_files import write_c, write_c_source
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model
from pneucli.stages import ingest
from pneucli.stages.pipeline_data import PipelineData

SMALL = "--small"
CONTROLLERS = "design/controllers"
VALVE_TEST_STEMS = ("step_+1.0V", "step_+3.0V", "step_+3.5V", "step_+10.0V")  # of a test of a valve; one is held out


def print_tables(tables: Mapping[str, Callable[..., object]], arguments: Sequence[str]) -> int:
    """Print the table that the first argument names, or of each a small one; return 1 where one returned False."""
    is_small = SMALL in arguments
    name, *rest = [one for one in arguments if one != SMALL] or [""]
    if name not in tables and (name or not is_small):
        raise SystemExit(f"no table {name!r}; wanted: {', '.join(tables)}")
    found = [tables[one](rest, is_small=is_small) for one in ([name] if name else tables)]
    return int(any(one is False for one in found) and not is_small)


def study_of(case: Path, folder: Path, most: int | None = None) -> PipelineData:
    """Return a case, ingested into an empty folder, as the stages after ``ingest`` see it."""
    path = case / "pipeline.toml"
    (folder / "ingest").mkdir()
    ingest.run(Context(path, load(path), folder / "ingest", folder))
    return PipelineData(Context(path, load(path), folder / "none", folder), max_samples=most)


def exam(folder: Path) -> Path:
    """Write an exam of one valve test with a lag of the spool; return its folder."""
    seal(folder, "case-001.json", generate_case(folder / "case-001", "valve", ("valve-lag",), "", 1.0, 2))
    shorten(folder / "case-001" / "pipeline.toml")
    return folder


def on_folders(arguments: Sequence[str], print_table: Callable[[list[Path]], None]) -> None:
    """Print the table of the folders that are named, or of a small exam."""
    if SMALL in arguments:
        with tempfile.TemporaryDirectory() as folder:
            print_table([exam(Path(folder))])
    else:
        print_table([Path(name) for name in arguments])


def shorten(path: Path) -> None:
    """Leave few valve tests in a pipeline file, the first part of each, and one of them held out."""
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    recordings: Any = document["recordings"]
    kept = tomlkit.aot()
    for table in recordings:
        is_valve_test = table["experiment"] == "valve"
        if is_valve_test:
            table["to"] = "0.7 s"
        if not is_valve_test or table["name"] in VALVE_TEST_STEMS:
            kept.append(table)
    document["recordings"] = kept
    path.write_text(tomlkit.dumps(document), encoding="utf-8")


def laboratory(condition: str = "usual") -> Laboratory:
    """Return a healthy axis of the exam."""
    return prepare_case("rig", "axis", (), "", 1.0, 1, parse(condition)).laboratory


def design(rig: Laboratory) -> tuple[Controller, Model, ClosedLoopSetup]:
    """Return the controller for the exact model of a rig, the model, and the sensors that the design assumes."""
    par, sensors = rig.parameters, rig.sensors
    one_chamber = par.arrangement == ONE_CHAMBER
    requirements = Requirements(
        quantum_x=sensors.position_step, noise_p=sensors.pressure, chamber_2="closed" if one_chamber else "valve"
    )
    model = model_of(par)
    p2 = float(np.sqrt(par.ambient * par.supply)) if one_chamber else None
    setup = ClosedLoopSetup(noise_p=sensors.pressure, quantum_x=sensors.position_step)
    return design_cascade(model, requirements, p2), model, setup


def exported(out: Path, rig: Laboratory, precision: str = "float64", *, replay: bool = False) -> Path:
    """Design for a rig; write controller and C as ``pneucli export --out OUT`` does; return the folder of the C.

    The replay of a minute, which takes longest, only where it is asked for.
    """
    controller, model, setup = design(rig)
    (out / CONTROLLERS).mkdir(parents=True, exist_ok=True)
    (out / CONTROLLERS / "best.json").write_text(controller.to_json(), encoding="utf-8")
    (out / "export").mkdir(exist_ok=True)
    if replay:
        write_c(out / "export", controller, model, setup, "small", precision)
    else:
        write_c_source(out / "export", controller, "small", precision)
    return out / "export"
