"""First guesses without a simulation: friction from the balance of forces, valve areas from the balance of mass."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from pneucli.identify.guesses.flow_paths import FlowPathData, flow_path_data
from pneucli.plausibility.required_inputs import volumes_to_identify
from pneucli.recording import Rig
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.imposed_motion import imposed_motion
from pneucli.simulate.model import Model, ValveForm
from pneucli.simulate.valve_forms.area import MAX_OVERLAP_RATIO, NO_VALVE, ValveArea
from pneucli.simulate.valve_forms.linear import LinearValve
from pneucli.simulate.valve_forms.switching import SwitchingValve

Array = NDArray[np.float64]

TINY = 1e-30  # a positive floor that keeps quotients and logarithms finite
MIN_SPEED_RATIO = 0.02  # of the largest speed, below which friction is not told by motion
SETTLING_RATIO = 0.01  # of the time for which a command is held, at its start, that is left out
MIN_COMMAND_STEP = 0.005  # of the largest command: after a smaller step there is nothing to settle
MIN_KNOTS, MAX_LEVELS = 3, 40
MIN_HELD_RATIO = 0.005  # of all the time, for which a command must be held to have a knot of its own
DEFAULT_KNOTS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)  # of the largest command: knots where none is held
LEVEL_RESOLUTION = 1e-4  # of the largest command: nearer commands are one level
PLACEHOLDER_VOLUME = 1e-3  # m^3, of a vessel of unknown volume: only areas over it mean anything
MIN_MASS_RATIO = 1e-3  # of the forces over the accelerations, where the motion is too slow to show any
DEAD_VOLUME_RATIO = (
    0.1  # of the volume that the piston sweeps: a dead volume that is not stated, before it is identified
)
MIN_KNOT_DISTANCE = 0.2  # of the logarithm of the command: nearer commands share a knot


def guess_base_model(experiments: Sequence[Experiment], rig: Rig, valve: str = "map") -> Model:
    """Return the base model as the measurements suggest it directly, with a valve of one of the ``GUESS_BY_VALVE_FORM``."""
    values = guess_friction([e for e in experiments if e.recording.kind.cylinder], rig)
    values |= guess_volumes(experiments, rig)
    values |= {name: k.start for name, k in rig.priors.items() if k.start is not None}
    volume, guess = values.get("rig.vessel_volume", PLACEHOLDER_VOLUME), GUESS_BY_VALVE_FORM[valve]
    dead = {f"dead_volume_{c}": values.get(f"rig.dead_volume_{c}", getattr(rig, f"dead_volume_{c}")) for c in (1, 2)}
    filled = replace(rig, **dead)
    first, second = (list(flow_path_data(experiments, filled, chamber, volume)) for chamber in (1, 2))
    known = guess(first, "valve") if first else NO_VALVE
    return Model(rig, (), values, known, guess(second, "valve_2") if second else None)


def guess_volumes(experiments: Sequence[Experiment], rig: Rig) -> dict[str, float]:
    """Return a vessel's volume as stated, and what to start from for volumes in m^3 that the rig leaves out."""
    values = (
        {"rig.vessel_volume": rig.vessel_volume or PLACEHOLDER_VOLUME} if any(e.vessel for e in experiments) else {}
    )
    if rig.vessel_volume is not None:
        values["rig.vessel_volume"] = rig.vessel_volume
    reach = rig.stroke or max((e.signal_ranges.high for e in experiments), default=0.0)
    swept = rig.piston_areas[0] * reach
    unknown = set(volumes_to_identify([e.recording for e in experiments], rig)) - {"rig.vessel_volume"}
    return values | dict.fromkeys(unknown, DEAD_VOLUME_RATIO * swept)


def guess_friction(experiments: Sequence[Experiment], rig: Rig) -> dict[str, float]:
    """Return Coulomb and viscous friction (and mass where unknown) by linear least squares of the forces."""
    rows, right = [], []
    for e in experiments:
        if "x" not in e.raw:
            continue
        _, v, a = imposed_motion(e)
        force = _driving_force(e, rig)
        moving = np.abs(v) > MIN_SPEED_RATIO * np.max(np.abs(v))
        known = 0.0 if rig.moving_mass is None else rig.moving_mass * a
        rows.append(np.column_stack([np.sign(v), v, a, np.ones_like(v)])[moving])
        right.append((force - known)[moving])
    if not rows:
        return {}
    design, target = np.vstack(rows), np.concatenate(right)
    if rig.moving_mass is not None:
        design = np.delete(design, 2, axis=1)
    lower = np.zeros(design.shape[1])
    lower[-1] = -np.inf  # a constant force is let go, so that it does not lean on the friction
    found = lsq_linear(design, target, bounds=(lower, np.inf)).x
    values = {"friction.coulomb": float(found[0]), "friction.viscous": float(found[1])}
    if rig.moving_mass is None:
        least = MIN_MASS_RATIO * float(np.abs(target).max() / max(np.abs(design[:, 2]).max(), TINY))
        values["rig.moving_mass"] = max(float(found[2]), least)
    return values


def _driving_force(e: Experiment, rig: Rig) -> Array:
    """Return the force on the piston but for friction, from pressures and driving force."""
    a1 = rig.piston_area_1 or 0.0
    a2 = a1 if rig.piston_area_2 is None else rig.piston_area_2
    p1, p2 = e.inputs[:, at.IN_P1] - rig.ambient_pressure, e.inputs[:, at.IN_P2] - rig.ambient_pressure
    return np.asarray(a1 * p1 - a2 * p2 + e.inputs[:, at.IN_FORCE])


def _settled_samples(shown: Sequence[FlowPathData]) -> tuple[Array, Array, Array]:
    """Return openings in V, mass flow, and flow per effective area where the valve has settled."""
    parts = []
    for one in shown:
        keep = _is_settled(one.opening) if one.experiment.vessel else np.ones(one.flow.size, dtype=bool)
        parts.append((one.opening[keep], one.flow[keep], one.mass_flux[keep]))
    opening, flow, per_area = (np.concatenate(column) for column in zip(*parts, strict=True))
    return opening, flow, per_area


def _is_settled(opening: Array) -> NDArray[np.bool_]:
    """Return where an opening (n,) has been held for a while, at least one sample, or has moved but slightly."""
    steps = np.diff(opening, prepend=np.nan)
    starts = np.flatnonzero(steps != 0.0)
    lengths = np.diff(np.append(starts, opening.size))
    since = np.arange(opening.size) - np.repeat(starts, lengths)
    slight = np.abs(steps[starts]) < MIN_COMMAND_STEP * np.abs(opening).max()
    return np.asarray((since >= 1.0 + np.repeat(SETTLING_RATIO * lengths, lengths)) | np.repeat(slight, lengths))


def _max_opening(shown: Sequence[FlowPathData]) -> float:
    return max(float(np.abs(one.opening).max()) for one in shown)


def guess_gain(flow_paths: Sequence[FlowPathData], label: str) -> LinearValve:
    """Return the valve with one gain for all commands."""
    command, q, per_area = _settled_samples(flow_paths)
    power = float(np.sum((per_area * command) ** 2))
    gain = max(float(np.sum(q * per_area * np.abs(command))) / max(power, TINY), TINY)
    return LinearValve(gain, _max_opening(flow_paths), label)


def guess_switching(flow_paths: Sequence[FlowPathData], label: str) -> SwitchingValve:
    """Return the valve with one area to fill and one to vent."""
    command, q, per_area = _settled_samples(flow_paths)
    sides = [np.sign(command) == sign for sign in (1.0, -1.0)]
    areas = [float(np.sum((q * per_area)[s])) / max(float(np.sum(per_area[s] ** 2)), TINY) for s in sides]
    fill, vent = (max(area, TINY) for area in areas)
    return SwitchingValve(fill, vent, _max_opening(flow_paths), label)


def guess_map(flow_paths: Sequence[FlowPathData], label: str) -> ValveArea:
    """Return the valve's area at the commands that were held longest."""
    command, q, per_area = _settled_samples(flow_paths)
    largest, samples = _max_opening(flow_paths), MIN_HELD_RATIO * sum(one.opening.size for one in flow_paths)
    sides = [_knots_of_direction(command, q, per_area, sign * largest, samples) for sign in (-1.0, 1.0)]
    knots = [(c, a) for commands, areas, _ in sides for c, a in zip(commands, areas, strict=True)]
    knots.sort()
    fill, vent = sides[1][2], sides[0][2]
    return ValveArea(tuple(c for c, _ in knots), tuple(a for _, a in knots), fill, vent, label=label)


GUESS_BY_VALVE_FORM: dict[str, Callable[[Sequence[FlowPathData], str], ValveForm]] = {
    "map": guess_map,
    "linear": guess_gain,
    "switching": guess_switching,
}  # of the valve, by what the pipeline file says


def _knots_of_direction(
    command: Array, q: Array, per_area: Array, largest: float, enough: float
) -> tuple[list[float], list[float], float]:
    """Return knots (V), areas (m^2) and overlap (V) of one direction, that of the ``largest`` command (V).

    A command that is held for ``enough`` samples has a knot.
    """
    mine, quantum = largest * command > 0, LEVEL_RESOLUTION * abs(largest)
    levels, times = np.unique(np.round(command[mine] / quantum), return_counts=True)
    levels, held = quantum * levels, times.astype(np.float64)
    if levels.size > MAX_LEVELS:  # commands of a closed loop: no level was held
        levels, held = largest * np.array(DEFAULT_KNOTS), np.ones(len(DEFAULT_KNOTS))
    elif np.sum(held >= enough) >= MIN_KNOTS:
        levels, held = levels[held >= enough], held[held >= enough]
    knots: list[float] = []
    areas: list[float] = []
    for level in levels[np.argsort(-held, kind="stable")]:
        if any(abs(np.log(level / k)) < MIN_KNOT_DISTANCE for k in knots):
            continue
        near = mine & (np.abs(command / level - 1.0) < 0.5 * MIN_KNOT_DISTANCE * (held.max() == 1) + 1e-3)
        area = float(np.sum(q[near] * per_area[near]) / max(np.sum(per_area[near] ** 2), 1e-30))
        if area > 0:
            knots.append(float(level))
            areas.append(area)
    order = np.argsort(np.abs(knots))
    knots, areas = [knots[i] for i in order], [areas[i] for i in order]
    return knots, areas, guess_overlap(np.abs(knots), np.array(areas))


def guess_overlap(commands: Array, areas: Array) -> float:
    """Return the overlap in V at which the areas (k,) in m^2 are nearest to a power law of the commands (k,) in V."""
    if commands.size < 3:
        return 0.0
    best, at_best = np.inf, 0.0
    for overlap in np.linspace(0.0, MAX_OVERLAP_RATIO * commands[0], 96):
        x = np.log(commands - overlap)
        misfit = np.polyfit(x, np.log(areas), 1, full=True)[1]
        if misfit.size and misfit[0] < best:
            best, at_best = float(misfit[0]), float(overlap)
    return at_best
