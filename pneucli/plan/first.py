"""The first programme of a rig that is only described: a typical model, and how little of it is known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.identify.estimation.parameters import FreeParameter
from pneucli.identify.estimation.score_test import initial_guesses
from pneucli.identify.guesses.valve_areas import LOOP_BAND
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.physics.declaration import BASE_PARAMETERS, Effect
from pneucli.plan.bench import Bench
from pneucli.plan.limits import Limits
from pneucli.plan.manoeuvres import candidate_manoeuvres
from pneucli.plan.power import Deviation
from pneucli.plan.simulation import simulate_manoeuvre, synthetic_recording
from pneucli.recording import Rig
from pneucli.simulate.model import Model, with_effect
from pneucli.simulate.preparation import prepare
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.simulate.valve_forms import NO_VALVE, LinearValve, SwitchingValve, ValveArea

KNOTS = (0.1, 0.25, 0.5, 1.0)  # of the command's range, at which a typical valve's area is a parameter
AREA_EXPONENT = 1.1  # of a typical valve's area over its command
OVERLAP_SHARE = 0.02  # of the command's range
FILL_TIME = 0.25  # s in which a typical valve fills the vessel
TOP_SPEED = 1.0  # m/s of a typical axis with the valve open
LOG_SIGMA = 0.7  # of a parameter that is known to a factor of two
RELATIVE_SIGMA = 0.5  # of another parameter's value
MODEL_ERROR = Deviation(5.0, 0.1)  # of the best model: the median on messy rigs (docs/development/experiments.md)
EXTREMES = {"fast valve, little friction": (2.0, 0.3), "slow valve, much friction": (0.5, 3.0)}


def typical_model(rig: Rig, benches: Sequence[Bench], valve: str = "map", effects: Sequence[Effect] = ()) -> Model:
    """Return a model of a described rig with typical friction, a typical valve, and effects as stated or typical.

    Args:
        rig: The rig.
        benches: Its benches.
        valve: Form of the valve: "map", "linear", "switching" or "pressure".
        effects: What the pipeline file says that the rig has.

    Returns:
        The model.
    """
    model = _base_model(rig, benches, valve)
    quantities = replace(rig_quantities(model), max_speed=TOP_SPEED)
    for effect in effects:
        if starts := initial_guesses(effect, quantities, rig.priors):
            model = with_effect(model, effect, starts[len(starts) // 2])
    return model


def _base_model(rig: Rig, benches: Sequence[Bench], valve: str) -> Model:
    command = max((bench.command_range for bench in benches), default=1.0)
    area = typical_area(rig)
    values = {} if rig.vessel_volume is None else {"rig.vessel_volume": rig.vessel_volume}
    if not rig.has_cylinder:
        return Model(rig, (), values, _valve(valve, area, command) if benches else NO_VALVE)
    model = Model(rig, (), values, _valve(valve, area, command))
    quantities = replace(rig_quantities(model), max_speed=TOP_SPEED)
    names = ["friction.coulomb", "friction.viscous"]
    names += ["rig.moving_mass"] if rig.moving_mass is None else []
    names += [n for n in ("rig.dead_volume_1", "rig.dead_volume_2") if getattr(rig, n.removeprefix("rig.")) is None]
    values |= {name: BASE_PARAMETERS[name].range_on(quantities).typical[0] for name in names}
    second = replace(_valve("map", area, command), label="valve_2") if rig.arrangement.drives_both else None
    return replace(model, values=values, valve_2=second if valve == "map" else None)


def typical_area(rig: Rig) -> float:
    """Return the effective area in m^2 of a typical valve at its full command.

    It lets a piston move at TOP_SPEED at choked flow, or fills the vessel in FILL_TIME.
    """
    gas = rig.gas_constant * rig.gas_temperature
    supply = rig.supply_pressure or 7.0 * rig.ambient_pressure
    flow_per_area = supply * np.sqrt(2.0 / gas) * 0.484  # kg/(s m^2), choked (thesis 2.43)
    if rig.piston_area_1 is not None:
        mean = 0.5 * (supply + rig.ambient_pressure)
        return float(mean * rig.piston_area_1 * TOP_SPEED / gas / flow_per_area)
    volume = rig.vessel_volume or 1e-4
    return float((supply - rig.ambient_pressure) * volume / (rig.heat_capacity_ratio * gas * FILL_TIME * flow_per_area))


def _valve(form: str, area: float, command: float) -> ValveArea | LinearValve | SwitchingValve:
    if form in ("linear", "pressure"):
        return LinearValve(area / (command if form == "linear" else LOOP_BAND * command), command)
    if form == "switching":
        return SwitchingValve(area, area, command)
    overlap = OVERLAP_SHARE * command
    shares = np.array([(k * command - overlap) / (command - overlap) for k in KNOTS]) ** AREA_EXPONENT
    knots = [(sign * k * command, float(area * s)) for sign in (-1.0, 1.0) for k, s in zip(KNOTS, shares, strict=True)]
    commands, areas = zip(*sorted(knots), strict=True)
    return ValveArea(tuple(commands), tuple(areas), overlap, overlap)


def extreme_models(model: Model) -> dict[str, Model]:
    """Return the typical model and those with a faster and a slower valve, less and more friction, by name."""
    found = {"typical model": model}
    for name, (valve, friction) in EXTREMES.items():
        values = {n: v * friction if n.startswith("friction.") else v for n, v in model.values.items()}
        second = None if model.valve_2 is None else model.valve_2.scaled(valve)
        found[name] = replace(model, values=values, valve=model.valve.scaled(valve), valve_2=second)
    return found


def sample_residual_models(
    benches: Sequence[Bench], limits: Limits, model: Model, horizon: float
) -> list[ResidualModel]:
    """Return the residual models of the first manoeuvre of each bench, from which scales and parameters follow."""
    experiments = []
    for bench in benches:
        first = next(iter(candidate_manoeuvres(bench, limits)))
        recording = synthetic_recording(first, simulate_manoeuvre(first, model), "plan", 1)
        experiments.append(prepare(recording, model.rig, horizon))
    return residual_models(experiments, whiten_initial_state=True)


def with_typical_spread(free: Sequence[FreeParameter]) -> list[FreeParameter]:
    """Return parameters with a prior, of which only the order of magnitude is known."""
    widths = [LOG_SIGMA if f.logarithmic else RELATIVE_SIGMA * max(abs(f.to_coordinate(f.start)), 0.1) for f in free]
    return [replace(f, prior_sigma=min(width, f.prior_sigma)) for f, width in zip(free, widths, strict=True)]
