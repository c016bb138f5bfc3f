"""First guesses of a valve's areas over its command, for each form of valve."""

from collections.abc import Callable, Sequence

import numpy as np

from pneucli.arrays import Array, Mask
from pneucli.identify.guesses.flow_paths import FlowPathData
from pneucli.simulate.model import ValveForm
from pneucli.simulate.valve_forms import MAX_OVERLAP_RATIO, LinearValve, SwitchingValve, ValveArea

TINY = 1e-30  # a positive floor that keeps quotients and logarithms finite
MIN_KNOTS, MAX_LEVELS = 3, 40
SETTLING_RATIO = 0.01  # of the duration of a held command, left out at its start
MIN_COMMAND_STEP = 0.005  # of the largest command; after a smaller step nothing has to settle
MIN_HELD_RATIO = 0.005  # of all samples: a command held for longer gets a knot of its own
OPEN_PERCENTILE = 98.0  # of the areas that a pressure loop opens: beyond it noise at a small flux counts
LOOP_BAND = 0.1  # of the largest command: the error at which such a loop opens fully, as its effect starts
DEFAULT_KNOTS = (0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)  # of the largest command: knots where none is held
LEVEL_RESOLUTION = 1e-4  # of the largest command: closer commands count as one level
MIN_KNOT_DISTANCE = 0.2  # of the logarithm of the command: closer commands share a knot


def _settled_samples(flow_paths: Sequence[FlowPathData]) -> tuple[Array, Array, Array]:
    """Return opening (V), mass flow (kg/s) and mass flux (kg/(s m^2)) where the valve has settled."""
    columns = []
    for one in flow_paths:
        settled = _is_settled(one.opening) if one.experiment.vessel else np.ones(one.flow.size, dtype=bool)
        columns.append((one.opening[settled], one.flow[settled], one.mass_flux[settled]))
    opening, flow, flux = (np.concatenate(column) for column in zip(*columns, strict=True))
    return opening, flow, flux


def _is_settled(opening: Array) -> Mask:
    """Mask where an opening (n,) has been held for a while, at least one sample, or has changed only slightly."""
    steps = np.diff(opening, prepend=np.nan)
    starts = np.flatnonzero(steps != 0.0)
    durations = np.diff(np.append(starts, opening.size))
    samples_held = np.arange(opening.size) - np.repeat(starts, durations)
    is_small_step = np.abs(steps[starts]) < MIN_COMMAND_STEP * np.abs(opening).max()
    return np.asarray(
        (samples_held >= 1.0 + np.repeat(SETTLING_RATIO * durations, durations)) | np.repeat(is_small_step, durations)
    )


def _max_opening(flow_paths: Sequence[FlowPathData]) -> float:
    return max(float(np.abs(one.opening).max()) for one in flow_paths)


def guess_gain(flow_paths: Sequence[FlowPathData], label: str) -> LinearValve:
    """Fit one gain for all commands to the flow.

    Args:
        flow_paths: The flow-path data of one chamber.
        label: Name of the valve.

    Returns:
        The linear valve; its gain is at least ``TINY``.

    """
    command, flow, flux = _settled_samples(flow_paths)
    sum_of_squares = float(np.sum((flux * command) ** 2))
    gain = max(float(np.sum(flow * flux * np.abs(command))) / max(sum_of_squares, TINY), TINY)
    return LinearValve(gain, _max_opening(flow_paths), label)


def _guess_loop(flow_paths: Sequence[FlowPathData], label: str) -> LinearValve:
    """Guess the area per volt of a pressure loop's error from the largest area that it opens."""
    command, flow, flux = _settled_samples(flow_paths)
    filling = (command > 0.0) & (flow > 0.0) & (flux > 0.0)
    largest = float(np.percentile((flow / flux)[filling], OPEN_PERCENTILE)) if filling.any() else TINY
    full = _max_opening(flow_paths)
    return LinearValve(max(largest, TINY) / (LOOP_BAND * full), full, label)


def _guess_switching(flow_paths: Sequence[FlowPathData], label: str) -> SwitchingValve:
    """Fit one filling and one venting area to the flow."""
    command, flow, flux = _settled_samples(flow_paths)
    directions = [np.sign(command) == sign for sign in (1.0, -1.0)]
    areas = [float(np.sum((flow * flux)[mask])) / max(float(np.sum(flux[mask] ** 2)), TINY) for mask in directions]
    fill, vent = (max(area, TINY) for area in areas)
    return SwitchingValve(fill, vent, _max_opening(flow_paths), label)


def guess_map(flow_paths: Sequence[FlowPathData], label: str) -> ValveArea:
    """Fit the valve's area at the commands that were held longest.

    Args:
        flow_paths: The flow-path data of one chamber.
        label: Name of the valve.

    Returns:
        The valve with its knots and overlaps.

    """
    command, flow, flux = _settled_samples(flow_paths)
    max_command, samples = _max_opening(flow_paths), MIN_HELD_RATIO * sum(one.opening.size for one in flow_paths)
    directions = [_knots_of_direction(command, flow, flux, sign * max_command, samples) for sign in (-1.0, 1.0)]
    knots = [(c, a) for commands, areas, _ in directions for c, a in zip(commands, areas, strict=True)]
    knots.sort()
    fill, vent = directions[1][2], directions[0][2]
    return ValveArea(tuple(c for c, _ in knots), tuple(a for _, a in knots), fill, vent, label=label)


GUESS_BY_VALVE_FORM: dict[str, Callable[[Sequence[FlowPathData], str], ValveForm]] = {
    "map": guess_map,
    "linear": guess_gain,
    "switching": _guess_switching,
    "pressure": _guess_loop,
}


def _knots_of_direction(
    command: Array, flow: Array, flux: Array, max_command: float, min_samples: float
) -> tuple[list[float], list[float], float]:
    """Return knots (V), areas (m^2) and overlap (V) of one direction, that of the signed command ``max_command`` (V).

    A command that is held for ``min_samples`` samples gets a knot.
    """
    in_direction, quantum = max_command * command > 0, LEVEL_RESOLUTION * abs(max_command)
    levels, counts = np.unique(np.round(command[in_direction] / quantum), return_counts=True)
    levels, held = quantum * levels, counts.astype(np.float64)
    if levels.size > MAX_LEVELS:  # commands of a closed loop hold no level
        levels, held = max_command * np.array(DEFAULT_KNOTS), np.ones(len(DEFAULT_KNOTS))
    elif np.sum(held >= min_samples) >= MIN_KNOTS:
        levels, held = levels[held >= min_samples], held[held >= min_samples]
    knots: list[float] = []
    areas: list[float] = []
    for level in levels[np.argsort(-held, kind="stable")]:
        if any(abs(np.log(level / k)) < MIN_KNOT_DISTANCE for k in knots):
            continue
        at_level = in_direction & (np.abs(command / level - 1.0) < 0.5 * MIN_KNOT_DISTANCE * (held.max() == 1) + 1e-3)
        area = float(np.sum(flow[at_level] * flux[at_level]) / max(np.sum(flux[at_level] ** 2), 1e-30))
        if area > 0:
            knots.append(float(level))
            areas.append(area)
    order = np.argsort(np.abs(knots))
    knots, areas = [knots[i] for i in order], [areas[i] for i in order]
    return knots, areas, guess_overlap(np.abs(knots), np.array(areas))


def guess_overlap(commands: Array, areas: Array) -> float:
    """Choose the overlap at which the areas come closest to a power law of the command beyond it.

    Args:
        commands: Positive commands in V, increasing, shape (k,).
        areas: Effective areas there in m^2, shape (k,).

    Returns:
        The overlap in V; 0 with fewer than three commands.

    >>> commands = np.array([1.0, 2.0, 4.0, 8.0])
    >>> round(guess_overlap(commands, 1e-6 * (commands - 0.5)), 2)
    0.5

    """
    if commands.size < 3:
        return 0.0
    smallest_misfit, best_overlap = np.inf, 0.0
    for overlap in np.linspace(0.0, MAX_OVERLAP_RATIO * commands[0], 96):
        x = np.log(commands - overlap)
        misfit = np.polyfit(x, np.log(areas), 1, full=True)[1]
        if misfit.size and misfit[0] < smallest_misfit:
            smallest_misfit, best_overlap = float(misfit[0]), float(overlap)
    return best_overlap
