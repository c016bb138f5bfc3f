"""Samples at a known pressure: a direct reading of a sensor's fault beats what a fit infers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pneucli.identify.residuals import ResidualModel
from pneucli.physics.declaration import Effect
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model

SENSOR_PORTS = {"p1": "read_p1", "p2": "read_p2"}
AMBIENT_TOLERANCE = 0.01  # of ambient pressure: so much weather moves it, where it is stated and not measured
MIN_REST_TIME = 0.2  # s, at the lowest level
REST_NOISE_FACTOR = 4.0  # times the sensor's, around that level
REFUTATION_FACTOR = 3.0  # times that doubt, by which a fault would have to show


def refuted_by_reading(model: Model, effect: Effect, views: Sequence[ResidualModel]) -> bool:
    """Whether samples at ambient pressure refute the fault of a pressure sensor that a model has.

    Such as an offset of -95 mbar where the sensor rests at ambient pressure in the same recordings.
    """
    experiments = {id(view.experiment.recording): view.experiment for view in views}.values()
    return any(
        abs(float(effect.ports[port](ambient, ambient, *model.effect_parameters(effect))) - ambient)  # type: ignore[arg-type]
        > REFUTATION_FACTOR * AMBIENT_TOLERANCE * ambient
        for signal, port in SENSOR_PORTS.items()
        if port in effect.ports
        for ambient in (e.rig.ambient_pressure for e in experiments if rests_at_ambient(e, signal))
    )


def rests_at_ambient(experiment: Experiment, signal: str) -> bool:
    """Whether the lowest level at which a pressure rests reads as ambient pressure: there the chamber is vented.

    With an offset the level would be elsewhere, and no vented chamber is below it.
    """
    recording, ambient = experiment.recording, experiment.rig.ambient_pressure
    if signal not in recording:
        return False
    values = recording[signal][np.isfinite(recording[signal])]
    if not values.size:
        return False
    level = float(np.quantile(values, 0.01))
    noise = experiment.noise[signal].rms if signal in experiment.noise else 0.0
    rested = (
        np.count_nonzero(np.abs(values - level) < AMBIENT_TOLERANCE * ambient + REST_NOISE_FACTOR * noise)
        * recording.period
    )
    return bool(abs(level - ambient) < AMBIENT_TOLERANCE * ambient and rested > MIN_REST_TIME)
