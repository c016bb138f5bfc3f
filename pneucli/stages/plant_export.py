"""``export --to fmu``: the identified plant for another simulator."""

from __future__ import annotations

import math
from typing import Any

from pneucli.export.fmu.package import write_fmu
from pneucli.export.fmu.plant import Interval, plant_of, require_valve
from pneucli.io.artifacts import read_table
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model
from pneucli.stages.flow_bench import require_recordings_over_time
from pneucli.stages.pipeline_data import PipelineData

PARAMETERS_FILE = "identify/parameters.parquet"


def export_plant(context: Context, study: PipelineData, model: Model) -> dict[str, Any]:
    """Write the FMU; return what an importer finds in it."""
    require_recordings_over_time(study)
    where = f"{context.path}, key model.effects"
    require_valve(study.experiments, f"{context.path}, key recordings")
    plant = plant_of(context.config.name, model, study.experiments, _intervals(context), where)
    return write_fmu(context.out, plant, where, context.options.get("fmi", "3.0"))


def _intervals(context: Context) -> dict[str, Interval]:
    """Return the 95 % interval of each identified parameter by name."""
    table = read_table(context.artifacts / PARAMETERS_FILE)
    rows = zip(table["name"], table["ci_low"], table["ci_high"], strict=True)
    found = {str(name): (float(low), float(high)) for name, low, high in rows}
    return {name: interval for name, interval in found.items() if all(map(math.isfinite, interval))}
