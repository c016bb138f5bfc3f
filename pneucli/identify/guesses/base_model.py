"""The first guess of the base model without a simulation: volumes, friction from the force balance, valve areas."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.identify.guesses.direct_friction import has_both_directions
from pneucli.identify.guesses.flow_paths import flow_path_data
from pneucli.identify.guesses.valve_areas import GUESS_BY_VALVE_FORM
from pneucli.plausibility.required_inputs import volumes_to_identify
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment, imposed_motion
from pneucli.simulate.model import Model
from pneucli.simulate.valve_forms import NO_VALVE

TINY = 1e-30  # a positive floor that keeps quotients and logarithms finite
MIN_SPEED_RATIO = 0.02  # of the largest speed; slower samples may be at rest
PLACEHOLDER_VOLUME = 1e-3  # m^3, of a vessel of unknown volume: only the ratio of area to volume is identifiable
MIN_MASS_RATIO = 1e-3  # of largest force over largest acceleration: the guess where motion is too slow for inertia
DEAD_VOLUME_RATIO = 0.1  # of the swept volume: the first guess of a dead volume that the file does not state


def guess_base_model(experiments: Sequence[Experiment], rig: Rig, valve: str = "map") -> Model:
    """Guess the base model directly from the measurements.

    Args:
        experiments: The training experiments.
        rig: The rig as the pipeline file states it.
        valve: Form of the valve, one of ``GUESS_BY_VALVE_FORM``.

    Returns:
        The model without effects; the start values of the file take precedence.

    """
    values = guess_friction([experiment for experiment in experiments if experiment.recording.kind.cylinder], rig)
    values |= _guess_volumes(experiments, rig)
    values |= {name: k.start for name, k in rig.priors.items() if k.start is not None}
    volume, guess = values.get("rig.vessel_volume", PLACEHOLDER_VOLUME), GUESS_BY_VALVE_FORM[valve]
    dead = {f"dead_volume_{c}": values.get(f"rig.dead_volume_{c}", getattr(rig, f"dead_volume_{c}")) for c in (1, 2)}
    rig_with_volumes = replace(rig, **dead)
    first, second = (list(flow_path_data(experiments, rig_with_volumes, chamber, volume)) for chamber in (1, 2))
    first_valve = guess(first, "valve") if first else NO_VALVE
    return Model(rig, (), values, first_valve, guess(second, "valve_2") if second else None)


def _guess_volumes(experiments: Sequence[Experiment], rig: Rig) -> dict[str, float]:
    """Guess the volumes that the rig leaves out."""
    values = (
        {"rig.vessel_volume": rig.vessel_volume or PLACEHOLDER_VOLUME}
        if any(experiment.vessel for experiment in experiments)
        else {}
    )
    if rig.vessel_volume is not None:
        values["rig.vessel_volume"] = rig.vessel_volume
    travel = rig.stroke or max((experiment.signal_ranges.high for experiment in experiments), default=0.0)
    swept = rig.piston_areas[0] * travel
    unknown = set(volumes_to_identify([experiment.recording for experiment in experiments], rig)) - {
        "rig.vessel_volume"
    }
    return values | dict.fromkeys(unknown, DEAD_VOLUME_RATIO * swept)


def guess_friction(experiments: Sequence[Experiment], rig: Rig) -> dict[str, float]:
    """Fit Coulomb and viscous friction, and the mass where it is unknown, to the forces by linear least squares.

    Args:
        experiments: Experiments with a cylinder; those without a known motion are left out.
        rig: The rig with areas and mass.

    Returns:
        ``friction.coulomb`` (N), ``friction.viscous`` (N s/m) and, where unknown, ``rig.moving_mass`` (kg); empty
        without a usable experiment.

    Raises:
        InputError: Nothing moves in any experiment, and the moving mass is not stated.

    References:
        Thesis (3.1) to (3.4).

    """
    rows, targets = [], []
    for experiment in experiments:
        if not experiment.motion_is_known:
            continue
        _, v, a = imposed_motion(experiment)
        force = _driving_force(experiment, rig)
        moving = (np.abs(v) > MIN_SPEED_RATIO * np.max(np.abs(v))) & experiment.is_free
        inertia = ((rig.moving_mass or 0.0) + experiment.recording.added_mass) * a
        rows.append(np.column_stack([np.sign(v), v, a, np.ones_like(v)])[moving])
        targets.append((force - inertia)[moving])
    if not rows:
        return {}
    design, target = np.vstack(rows), np.concatenate(targets)
    if not target.size and rig.moving_mass is None:
        mend = "check the columns and units of x, v and a"
        raise InputError("friction recordings", "no motion in any of them", "a piston that moves", mend, code="E062")
    if rig.moving_mass is not None:
        design = np.delete(design, 2, axis=1)
    if not has_both_directions(design[:, 0]):  # nothing tells a constant force from dry friction
        design[:, -1] = 0.0
    # the constant force has no bounds, so that it does not bias the friction
    solution = _least_squares_at_least_zero(design, target, design.shape[1] - 1)
    values = {"friction.coulomb": float(solution[0]), "friction.viscous": float(solution[1])}
    if rig.moving_mass is None:
        min_mass = MIN_MASS_RATIO * float(np.abs(target).max() / max(np.abs(design[:, 2]).max(), TINY))
        values["rig.moving_mass"] = max(float(solution[2]), min_mass)
    return values


def _least_squares_at_least_zero(design: Array, target: Array, bounded: int) -> Array:
    """Solve a linear least-squares problem whose first unknowns are not negative.

    >>> _least_squares_at_least_zero(np.eye(2), np.array([-3.0, -4.0]), 1).tolist()
    [0.0, -4.0]
    """
    k = design.shape[1]
    triangle: Array = np.linalg.qr(np.column_stack([design, target]))[1]  # the same problem in k + 1 rows
    best, lowest = np.zeros(k), np.inf
    for is_zero in itertools.product((False, True), repeat=bounded):
        free = [j for j in range(k) if j >= bounded or not is_zero[j]]
        solution = np.zeros(k)
        solution[free] = np.linalg.lstsq(triangle[:, free], triangle[:, k])[0]
        cost = float(np.sum((triangle[:, :k] @ solution - triangle[:, k]) ** 2))
        if cost < lowest and (solution[:bounded] >= 0.0).all():
            best, lowest = solution, cost
    return best


def _driving_force(experiment: Experiment, rig: Rig) -> Array:
    """Return the force on the piston from pressures and driving force in N, without friction."""
    a1 = rig.piston_area_1 or 0.0
    a2 = a1 if rig.piston_area_2 is None else rig.piston_area_2
    p1, p2 = (
        experiment.inputs[:, at.IN_P1] - rig.ambient_pressure,
        experiment.inputs[:, at.IN_P2] - rig.ambient_pressure,
    )
    return np.asarray(a1 * p1 - a2 * p2 + experiment.inputs[:, at.IN_FORCE])
