"""What ``[rig]`` and ``[signals]`` state of effects of the catalogue: a spring, the axis' angle, a sensor's lag."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from pneucli.config.rig_table import CylinderTable
from pneucli.config.signal_tables import SignalsTable
from pneucli.config.stage_tables import ModelTable, ParameterTable
from pneucli.experiments import ExperimentKind
from pneucli.units import STANDARD_GRAVITY


def model_with_stated(
    model: ModelTable,
    cylinder: CylinderTable,
    signals: SignalsTable,
    kinds: Sequence[ExperimentKind],
    tolerances: Mapping[str, float],
) -> ModelTable:
    """Return ``[model]`` with the effects that the rig and the sensors state, at the values that they state.

    What ``[model.parameters]`` says of such a parameter counts in place of it; one with a standard deviation in
    ``tolerances`` is identified. Raises ValueError where what is stated needs something that is not.
    """
    known = dict(_stated(cylinder, signals, kinds))
    if not known:
        return model
    from pneucli.physics.effects import catalogue  # noqa: PLC0415 - it takes a moment, and few files need it

    parameters = [(p, f"{effect.name}.{p.name}") for effect in catalogue().values() for p in effect.parameters]
    places = {p.stated: name for p, name in parameters}
    of_candidates = {name for p, name in parameters if p.refines}  # they describe an effect that may be absent
    stated = {places[word]: value for word, value in known.items()}
    deviations = {places[word]: tolerances[word] for word in known if word in tolerances}
    names = list(dict.fromkeys(name.partition(".")[0] for name in stated if name not in of_candidates))
    own = {
        name: ParameterTable(start=value, sigma=deviations[name]) if name in deviations else ParameterTable(fixed=value)
        for name, value in stated.items()
    }
    return model.model_copy(
        update={
            "effects": [*model.effects, *(name for name in names if name not in model.effects)],
            "parameters": own | model.parameters,
        }
    )


def _stated(
    cylinder: CylinderTable, signals: SignalsTable, kinds: Sequence[ExperimentKind]
) -> Iterator[tuple[str, float]]:
    """Yield what is stated, in the words of the parameters' ``stated``, with its values in SI."""
    if any(kind.cylinder for kind in kinds):
        yield from _spring(cylinder)
        if cylinder.angle is not None:
            if cylinder.moving_mass is None:
                raise ValueError("angle tells how the weight acts, and no moving_mass is stated; wanted it as well")
            gravity = STANDARD_GRAVITY * math.sin(cylinder.angle)
            yield "weight", cylinder.moving_mass * gravity
            yield "gravity along the axis", gravity
    lags = {one.lag for name, one in signals.present().items() if name in ("p1", "p2") and one.lag is not None}
    if len(lags) > 1:
        raise ValueError("p1 and p2 state different lags; wanted one for both")
    if not all(kind.steady for kind in kinds):
        yield from (("lag", lag) for lag in lags)


def _spring(cylinder: CylinderTable) -> Iterator[tuple[str, float]]:
    """Yield rate and relaxed position of a spring, stated as such or as the range of pressure over the stroke."""
    rate, preload = cylinder.spring, cylinder.preload
    if cylinder.bench_range is not None:
        if rate is not None or preload is not None:
            raise ValueError("bench_range is rate and preload of the spring; leave spring and preload out")
        if cylinder.piston_area_1 is None or cylinder.stroke is None:
            raise ValueError("bench_range needs piston_area_1 and stroke; wanted both as well")
        low, high = cylinder.bench_range
        rate, preload = (high - low) * cylinder.piston_area_1 / cylinder.stroke, low * cylinder.piston_area_1
    if rate is not None:
        yield "spring", rate
        yield "relaxed position of the spring", -(preload or 0.0) / rate
    elif preload is not None:
        raise ValueError("preload belongs to a spring; wanted the rate of the spring as well")
