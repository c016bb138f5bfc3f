"""``export``: the designed controller, the identified maps and the plant for other programs."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pneucli.controller.laws import find_law
from pneucli.controller.parameters import Controller
from pneucli.export import export_files
from pneucli.export.controller_program import PREFIX, controller_hash
from pneucli.export.fmu.package import write_fmu
from pneucli.export.fmu.plant import Interval, plant_of, require_valve
from pneucli.figure import to_answer
from pneucli.io.artifacts import read_table
from pneucli.messages.export import Answer, ExportedController, PlantAnswer, PrecisionCost
from pneucli.messages.progress import counted
from pneucli.pipeline.graph import Context, NotApplicable
from pneucli.stages.control_laws import closed_loop_setup, load_controller
from pneucli.stages.flow_bench import require_recordings_over_time
from pneucli.stages.pipeline_data import PipelineData, parameter_intervals

TARGETS = ("c", "mat", "csv", "st")  # of the controller and the maps
PLANT_TARGET = "fmu"
TABLES = (
    "identify/valve_map",
    "identify/valve_inverse",
    "identify/valve_lack_of_fit",
    "identify/valve_areas",
    "identify/parameters",
    "identify/friction_models",
    "identify/tp_vertices",
    "identify/tp_weights",
    "design/sector",
    "design/gains",
    "design/lmi",
)


def run(context: Context) -> dict[str, Any]:
    """Write what was asked for (``options["to"]``, by default all of the controller); return the files' names."""
    wanted = context.options.get("to") or TARGETS
    of_controller, plant = [target for target in wanted if target != PLANT_TARGET], None
    study = PipelineData(context)
    exported = _export_controller(study, of_controller) if of_controller else None
    if PLANT_TARGET in wanted:
        context.progress("compiling the plant")
        plant = export_plant(study)
    files = sorted(path.name for path in context.out.iterdir() if not path.name.startswith("."))
    return to_answer(Answer("pneucli/export/1", context.config.name, exported, plant, files))


def _export_controller(study: PipelineData, wanted: Sequence[str]) -> ExportedController:
    """Write the controller and the maps; raises NotApplicable where no controller was designed."""
    context = study.context
    if "design" not in context.answers:
        found = "no controller to export, since there is no axis to control"
        raise NotApplicable(
            f"{context.path}", found, "a cylinder and a recording of it with its valve", "--to fmu", code="E071"
        )
    name = context.options.get("controller") or context.answers["design"]["requirements"]["controller"]
    controller = load_controller(context.artifacts / "design", find_law(name, "--controller").name)
    precision = context.options.get("precision", "float64")
    prefix = context.options.get("prefix", PREFIX)
    difference: PrecisionCost | None = None
    for i, target in enumerate(wanted):
        context.progress(counted(f"writing {target}", i, len(wanted)))
        if target in ("c", "st"):
            bench = closed_loop_setup(context.answers["design"])
            about = (context.out, controller, study.identified_model, bench, context.config.name)
            if target == "c":
                difference = export_files.write_c(*about, precision, prefix)
            else:
                export_files.write_st(*about, prefix)
        else:
            _write_tables(context.out, target, controller, _tables(context.artifacts))
    precision = precision if "c" in wanted else "float64"
    if {"c", "st"} & set(wanted):
        export_files.write_replay(context.out, controller, context.config.name, precision)
    return ExportedController(
        controller.law, controller.period, controller_hash(controller, precision), precision, difference
    )


def _tables(artifacts: Path) -> dict[str, export_files.Columns]:
    """Return the tables that earlier stages wrote, those that this rig has."""
    return {
        Path(n).name: read_table(artifacts / f"{n}.parquet") for n in TABLES if (artifacts / f"{n}.parquet").exists()
    }


def _write_tables(out: Path, target: str, controller: Controller, tables: dict[str, export_files.Columns]) -> None:
    tables = {**tables, "inverse_area": export_files.inverse_table(controller)}
    if target == "mat":
        export_files.write_mat(out / "pneucli_design.mat", controller, tables)
        return
    for name, table in {**tables, "controller": export_files.controller_table(controller)}.items():
        export_files.write_csv(out / f"{name}.csv", table)


def export_plant(study: PipelineData) -> PlantAnswer:
    """Write the FMU; return what an importer finds in it."""
    context = study.context
    require_recordings_over_time(study)
    where = f"{context.path}, key model.effects"
    require_valve(study.experiments, f"{context.path}, key recordings")
    plant = plant_of(context.config.name, study.identified_model, study.experiments, _intervals(context), where)
    return write_fmu(context.out, plant, where, context.options.get("fmi", "3.0"))


def _intervals(context: Context) -> dict[str, Interval]:
    """Return the 95 % interval of each identified parameter by name."""
    found = parameter_intervals(context.artifacts)
    return {name: interval for name, interval in found.items() if all(map(math.isfinite, interval))}
