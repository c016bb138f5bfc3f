"""What the pipeline file says of the instruments: calibrations, and how well volume and temperature are known."""

from __future__ import annotations

import math

from pneucli.identify.valve.uncertainty import DEFAULT_TEMPERATURE, Measurement
from pneucli.stages.pipeline_data import PipelineData


def measurement_of(study: PipelineData) -> Measurement:
    """Return the instruments of a pipeline: ``calibration`` of ``[signals]``, ``sigma`` of the vessel's volume.

    The calibration of ``temperature`` holds for the gas temperature of tests that do not record it, too.
    """
    config = study.context.config
    present = config.signals.present()
    calibrations = config.calibrations
    volume = study.rig.priors.get("rig.vessel_volume")
    temperature = calibrations.get("temperature")
    return Measurement(
        calibrations,
        frozenset(name for name, one in present.items() if one.gauge),
        volume.sigma if volume is not None and math.isfinite(volume.sigma) else None,
        temperature.zero if temperature is not None and temperature.zero else DEFAULT_TEMPERATURE,
    )
