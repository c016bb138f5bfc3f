"""Identify friction from recordings of a cylinder (thesis chapter 6)."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.figure import Figure
from pneucli.identify.friction.kinematics import Motion, estimate_motion, with_contact
from pneucli.identify.friction.model_error import Deviation, StickSlipReplay, model_deviations, replay_stick_slip
from pneucli.identify.friction.models_a_to_f import (
    DEFAULT_NODES,
    TITLES,
    FrictionModel,
    ModelName,
    VelocityDomain,
    identify_models,
)
from pneucli.identify.friction.regression import FrictionFit, fit_coulomb, fit_stribeck
from pneucli.identify.friction.samples import (
    AveragedFriction,
    FrictionCurve,
    MovingSamples,
    StickSlip,
    average_stick_slips,
    binned_curve,
    find_stick_slips,
    pool_samples,
)
from pneucli.messages.findings import Finding
from pneucli.messages.identify import BreakAway, OverPressure, Repeats
from pneucli.physics.declaration import Effect
from pneucli.physics.ports import PORTS
from pneucli.quantities import Z95
from pneucli.recording import Recording
from pneucli.simulate.model import Model

MIN_STROKE_SPEED_RATIO = 0.5  # of the median speed while moving: slower samples belong to a reversal


@dataclass(frozen=True)
class KineticFriction:
    """Friction of one recording that strokes back and forth, and its pressures (Pa).

    ``forward`` and ``backward`` are medians (N) of the force that remains without pressure forces and inertia;
    ``friction`` is half their difference, ``offset`` (a constant force, or an error of area or load cell) half their
    sum. ``speed`` is the median speed of stroking (m/s); ``pressures`` are the medians of p1 and p2 (Pa), where
    recorded.
    """

    recording: str
    pressures: dict[str, float]
    speed: float
    forward: Figure
    backward: Figure
    friction: Figure
    offset: Figure


def kinetic_friction(motion: Motion, mass: float) -> KineticFriction | None:
    """Compute the kinetic friction of one recording.

    Args:
        motion: Motion and driving force of the recording.
        mass: Moving mass in kg.

    Returns:
        The friction; None where the piston does not move in both directions.

    """
    moving = motion.sliding(1)  # a median is insensitive to smoothing next to a reversal
    if not moving.any():
        return None
    speed = float(np.median(np.abs(motion.v[moving])))
    stroking = moving & (np.abs(motion.v) > MIN_STROKE_SPEED_RATIO * speed)
    directions = [stroking & (np.sign(motion.v) == d) for d in (1, -1)]
    if not all(mask.any() for mask in directions):
        return None
    friction = motion.friction(mass)
    (forward, e1), (backward, e2) = (
        _bootstrapped_median(friction[mask], motion.time[mask], motion.block_length) for mask in directions
    )
    half_error = float(np.hypot(e1, e2)) / 2
    return KineticFriction(
        recording=motion.recording.name,
        pressures={n: float(np.nanmedian(motion.recording[n])) for n in ("p1", "p2") if n in motion.recording},
        speed=float(np.median(np.abs(motion.v[stroking]))),
        forward=_with_interval(forward, e1),
        backward=_with_interval(backward, e2),
        friction=_with_interval(0.5 * (forward - backward), half_error),
        offset=_with_interval(0.5 * (forward + backward), half_error),
    )


def _bootstrapped_median(force: Array, time: Array, block_length: float) -> tuple[float, float]:
    """Return the median and its standard error, by a bootstrap over blocks of ``block_length`` s."""
    _, block = np.unique(np.floor(time / block_length), return_inverse=True)
    order = np.argsort(block, kind="stable")
    parts = np.split(force[order], np.cumsum(np.bincount(block))[:-1])
    rng = np.random.default_rng(0)
    picks = rng.integers(len(parts), size=(200, len(parts)))
    medians = [np.median(np.concatenate([parts[i] for i in row])) for row in picks]
    return float(np.median(force)), float(np.std(medians))


def _with_interval(value: float, error: float) -> Figure:
    return Figure(value, value - Z95 * error, value + Z95 * error, "N")


MAX_STATES = 100  # of each recording, at which a factor is evaluated
BY_BRANCH, BY_DIRECTION, NO_MODEL = set("DEF"), set("CF"), set[str]()
# the models that can represent an effect at each port of friction; D has no Stribeck rise while slowing
MODELS_BY_PORT = {
    "dry_rise": set("ABCF"),
    "slowing": BY_BRANCH,
    "slowing_viscous": BY_BRANCH,
    "viscous_factor": BY_DIRECTION,
}
MAX_RESIDUAL_TO_NOISE = 1.5  # times the sensors' noise: a larger residual of model A is not noise
MAX_STRIBECK_VELOCITY_RATIO = 0.25  # of the highest speed: beyond it the fall of friction is not fully observed
MIN_REST_SAMPLES = 5  # at rest before a break-away
BREAKAWAY_SAMPLES = 3  # the last samples at rest, whose mean force is the break-away force
MAX_PRESSURE_DIFFERENCE = 0.1  # of the gauge pressure, within which recordings repeat each other
MAX_SPEED_DIFFERENCE = 0.3  # of the speed, within which kinetic friction changes little
BREAKAWAY_STROKE_RATIO = 0.2  # of a stroke: the part that contains its break-away
MIN_LEVELS = 3  # of pressure, from which a line has a standard error


def break_away(motion: Motion, mass: float = 0.0) -> BreakAway | None:
    """Return the break-away forces of one recording; None where the piston never rests before it moves.

    Args:
        motion: The motion and what drives it.
        mass: All mass in kg that a machine accelerates with the piston; its inertia is no friction.

    """
    strokes = _breakaway_forces_of_strokes(motion, mass) if motion.imposed else _breakaway_forces_at_rest(motion)
    forces = np.array(list(strokes))
    forces = forces[np.isfinite(forces)]
    if not forces.size:
        return None
    median, error = float(np.median(forces)), 1.2533 * float(np.std(forces)) / np.sqrt(forces.size)  # of a median
    low, high = (median - Z95 * error, median + Z95 * error) if forces.size > 1 else (np.nan, np.nan)
    force = Figure(median, low, high, "N")
    return BreakAway(motion.recording.name, force, float(forces.min()), float(forces.max()), forces.size)


def _breakaway_forces_at_rest(motion: Motion) -> Iterator[float]:
    """Yield the driving force at the end of each rest of a free piston off the ends of its stroke."""
    is_rest = np.abs(motion.v) <= motion.rest_speed
    for k in np.flatnonzero(is_rest[:-1] & ~is_rest[1:] & ~motion.contact[:-1]):
        if k + 1 >= MIN_REST_SAMPLES and is_rest[k + 1 - MIN_REST_SAMPLES : k + 1].all():
            yield abs(float(np.nanmean(motion.drive[k + 1 - BREAKAWAY_SAMPLES : k + 1])))


def _breakaway_forces_of_strokes(motion: Motion, mass: float) -> Iterator[float]:
    """Yield the largest friction at the start of each stroke that a machine makes: it turns before the seal lets go."""
    friction = motion.smooth_drive - mass * motion.smooth_a
    for direction, first, end in _strokes(motion):
        early = slice(max(first - MIN_REST_SAMPLES, 0), first + int(BREAKAWAY_STROKE_RATIO * (end - first)))
        yield float(np.max(direction * friction[early], initial=-np.inf, where=~motion.contact[early]))


def _strokes(motion: Motion) -> list[tuple[float, int, int]]:
    """Return direction, first sample and end of each stroke; faults of the position of a few samples end none."""
    directions = np.where(np.abs(motion.v) > motion.rest_speed, np.sign(motion.v), 0.0)
    edges = np.flatnonzero(np.diff(directions, prepend=0.0, append=0.0)).tolist()
    strokes: list[tuple[float, int, int]] = []
    has_rested = False
    for first, end in pairwise(edges):
        direction, is_short = float(directions[first]), end - first < MIN_REST_SAMPLES
        has_rested |= not direction and not is_short
        if not direction or is_short:
            continue
        if strokes and strokes[-1][0] == direction and not has_rested:
            strokes[-1] = direction, strokes[-1][1], end
        else:
            strokes.append((direction, first, end))
        has_rested = False
    return [one for one in strokes if one[2] - one[1] >= MIN_REST_SAMPLES / BREAKAWAY_STROKE_RATIO]


def pressure_dependence(levels: Sequence[KineticFriction], ambient: float) -> OverPressure | None:
    """Fit a line to the kinetic friction of recordings over pressure.

    Args:
        levels: Kinetic friction of the recordings.
        ambient: Ambient pressure in Pa.

    Returns:
        The line; None with fewer than three recordings, or at one pressure.

    """
    with_pressure = [k for k in levels if "p1" in k.pressures]
    p = np.array([k.pressures["p1"] - ambient for k in with_pressure])
    if p.size < MIN_LEVELS or np.ptp(p) <= MAX_PRESSURE_DIFFERENCE * np.abs(p).max():
        return None
    design, force = np.column_stack([np.ones(p.size), p / 1e5]), np.array([k.friction.value for k in with_pressure])
    coefficients, squares, *_ = np.linalg.lstsq(design, force, rcond=None)
    errors = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * float(np.sum(squares)) / (p.size - 2))
    (at_ambient, slope), (e0, e1) = coefficients.tolist(), errors.tolist()
    return OverPressure(
        Figure(at_ambient, at_ambient - Z95 * e0, at_ambient + Z95 * e0, "N"),
        Figure(1e-5 * slope, 1e-5 * (slope - Z95 * e1), 1e-5 * (slope + Z95 * e1), "N/Pa"),
    )


def repeatability(levels: Sequence[KineticFriction], ambient: float) -> list[Repeats]:
    """Group recordings at one pressure and speed.

    Args:
        levels: Kinetic friction of the recordings.
        ambient: Ambient pressure in Pa.

    Returns:
        The groups of at least two recordings, in the recordings' order.

    """
    groups: list[list[KineticFriction]] = []
    for level in levels:
        group = next((g for g in groups if _is_repeat(g[0], level, ambient)), None)
        if group is None:
            groups.append([level])
        else:
            group.append(level)
    out = []
    for group in groups:
        values = np.array([k.friction.value for k in group])
        if len(group) > 1:
            spread = float(np.std(values, ddof=1) / values.mean())
            out.append(Repeats([k.recording for k in group], float(values.mean()), "N", spread))
    return out


def _is_repeat(one: KineticFriction, other: KineticFriction, ambient: float) -> bool:
    if one.pressures.keys() != other.pressures.keys():
        return False
    pairs = [(one.speed, other.speed, MAX_SPEED_DIFFERENCE)]
    pairs += [(p - ambient, other.pressures[n] - ambient, MAX_PRESSURE_DIFFERENCE) for n, p in one.pressures.items()]
    return all(abs(a - b) <= share * max(abs(a), abs(b), 1e-9) for a, b, share in pairs)


MIN_MOVING_SAMPLES = 100  # of all training recordings
MAX_RELATIVE_MASS_ERROR = 0.5  # half the interval over the value: a less certain mass counts as not identifiable


@dataclass(frozen=True)
class FrictionIdentification:
    """The results of the friction tests.

    ``mass`` (kg) is stated (interval of no width) or identified; None where it is not identifiable: inertia is then
    neglected and a22 of the TP models is that of 1 kg. ``parameters`` are model A's, with ``offset``, the constant
    force (N, positive where it pushes toward x = 0). ``models`` are A to F (A to C where only one branch was measured).
    ``deviations`` are the thesis tables 6.2 and 6.3, ``replays`` one stick-slip under each model. ``deviations``,
    ``replays``, ``kinetic`` friction, ``break_aways``, ``pressure_dependence`` and ``repeatability`` include the test
    recordings; all else uses the training ones. ``removed_effects`` names the effects of forces, mass and sensors that
    were removed, ``unmodelled_effects`` for each of A to F the effects on friction that it cannot represent.
    """

    mass: Figure | None
    parameters: Mapping[str, Figure]
    domain: VelocityDomain
    motions: tuple[Motion, ...]
    curves: tuple[FrictionCurve, ...]
    stick_slips: tuple[StickSlip, ...]
    averages: tuple[AveragedFriction, ...]
    models: tuple[FrictionModel, ...]
    deviations: tuple[Deviation, ...]
    replays: tuple[StickSlipReplay, ...]
    kinetic: tuple[KineticFriction, ...]
    break_aways: tuple[BreakAway, ...]
    pressure_dependence: OverPressure | None
    repeatability: tuple[Repeats, ...]
    removed_effects: tuple[str, ...]
    unmodelled_effects: Mapping[ModelName, tuple[str, ...]]
    warnings: tuple[Finding, ...]

    @property
    def offset(self) -> float:
        """The constant force in N."""
        return self.parameters["offset"].value if "offset" in self.parameters else 0.0

    def model(self, name: str) -> FrictionModel:
        """Return a model by its letter; raise InputError where these recordings did not give it."""
        for one in self.models:
            if one.name == name:
                return one
        raise InputError("friction model", name, ", ".join(m.name for m in self.models), code="E091")


def identify_friction(
    recordings: Sequence[Recording],
    model: Model,
    nodes: int | None = None,
    max_velocity: float | None = None,
    sign_steepness: float | None = None,
) -> FrictionIdentification:
    """Identify friction from the friction tests, or from axis recordings without any.

    Forces, mass and sensor faults of the model are removed first, and act in every simulation. Recordings of use
    ``train`` are fitted.

    Args:
        recordings: The recordings.
        model: The model with the rig and its effects.
        nodes: Number of grid points of the TP models.
        max_velocity: End of their velocities in m/s; by default the highest of the tests.
        sign_steepness: Steepness of the smoothed sign in s/m; by default what the sensors resolve.

    Returns:
        The identification.

    Raises:
        InputError: There is no such recording, drive or motion was not recorded, or hardly anything moves.

    """
    every = with_contact([estimate_motion(r, model) for r in _friction_recordings(recordings)], model.rig.stroke)
    motions = tuple(m for m in every if m.valid.any())  # a piston that stands on an end throughout shows no friction
    train = [m for m in motions if m.recording.use == "train"]
    warnings: list[Finding] = []
    mass = _mass(train, warnings)
    inertia = mass.value if mass else 0.0
    samples, unmodelled = pool_samples(train, inertia), unmodelled_effects(model, train)
    if len(samples) < MIN_MOVING_SAMPLES:
        found, wanted = f"{len(samples)} moving samples", f"at least {MIN_MOVING_SAMPLES}"
        raise InputError("friction recordings", found, wanted, "move further", code="E062")
    if not samples.both_directions:
        warnings.append(Finding("one-direction"))
    fit_a = fit_stribeck(samples, offset=samples.both_directions)
    max_speed = max(float(np.abs(m.v[m.valid]).max()) for m in motions)  # the models cover the velocities of the tests
    resolution = max(m.rest_speed for m in train)
    domain = VelocityDomain(max_velocity or max_speed, resolution, nodes or DEFAULT_NODES, sign_steepness)
    models = identify_models(samples, fit_a, domain, inertia or 1.0)
    stick_slips = tuple(c for m in train if not m.imposed for c in find_stick_slips(m, inertia))
    levels = tuple(k for m in motions if (k := kinetic_friction(m, inertia)))
    ambient, imposed = model.rig.ambient_pressure, {m.recording.name for m in motions if m.imposed}
    strokes = [k for k in levels if k.recording in imposed]  # in other recordings the pressure changes during motion
    return FrictionIdentification(
        mass=mass,
        parameters=fit_a.values(),
        domain=domain,
        motions=motions,
        curves=tuple(binned_curve(samples, branch) for branch in ("accelerating", "slowing", "both")),
        stick_slips=stick_slips,
        averages=tuple(average_stick_slips(stick_slips)),
        models=models,
        deviations=model_deviations(models, motions, inertia),
        replays=replay_stick_slip(models, motions, stick_slips, inertia),
        kinetic=levels,
        break_aways=tuple(b for m in motions if (b := break_away(m, inertia))),
        pressure_dependence=pressure_dependence(strokes, ambient),
        repeatability=tuple(repeatability(strokes, ambient)),
        removed_effects=train[0].non_friction.effect_names,
        unmodelled_effects={m.name: unmodelled[m.name] for m in models},
        warnings=(
            *warnings,
            *missing_model_warnings(models, samples),
            *model_a_warnings(fit_a, samples, unmodelled),
            *level_warnings(strokes),
        ),
    )


def _friction_recordings(recordings: Sequence[Recording]) -> list[Recording]:
    moving = [r for r in recordings if r.kind.cylinder]
    tests = [r for r in moving if not r.kind.valve] or moving
    if not any(r.use == "train" for r in tests):
        raise InputError(
            "recordings", "no friction test to train on", 'experiment = "friction", use = "train"', code="E061"
        )
    return tests


def _mass(train: Sequence[Motion], warnings: list[Finding]) -> Figure | None:
    """Return the moving mass: stated, or fitted together with Coulomb and viscous friction where it is observable."""
    if stated_mass := train[0].non_friction.model.rig.moving_mass:
        mass = stated_mass + train[0].non_friction.added_mass
        return Figure(mass, mass, mass, "kg")
    samples = pool_samples(train, 0.0)
    fit = fit_coulomb(samples, offset=samples.both_directions, mass=True)
    estimate = fit.values()["mass"]
    if estimate.value and estimate.high - estimate.value < MAX_RELATIVE_MASS_ERROR * estimate.value:
        return estimate
    if not all(m.imposed for m in train):
        raise InputError(
            "rig.cylinder.moving_mass",
            "missing, and these recordings do not identify it",
            "the moving mass",
            code="E063",
        )
    warnings.append(Finding("mass-not-identifiable"))
    return None


def missing_model_warnings(models: Sequence[FrictionModel], samples: MovingSamples) -> Iterator[Finding]:
    """Yield a warning where the samples of a branch are too few for some of the models A to F.

    Args:
        models: The identified models.
        samples: The moving samples.

    Yields:
        The names of the missing models and the number of samples of each branch.

    """
    missing = [name for name in TITLES if name not in {m.name for m in models}]
    if missing:
        counts = {
            "accelerating": int(np.count_nonzero(samples.branch > 0)),
            "slowing": int(np.count_nonzero(samples.branch < 0)),
        }
        yield Finding("models-missing", {"models": ", ".join(missing), **counts})


def model_a_warnings(
    fit: FrictionFit, samples: MovingSamples, unmodelled: Mapping[ModelName, tuple[str, ...]]
) -> Iterator[Finding]:
    """Yield warnings about the fit of model A.

    Args:
        fit: The fit of model A.
        samples: The moving samples.
        unmodelled: For each model the effects of the pipeline's model that it cannot represent.

    Yields:
        A significant constant force, a misfit, and parameters that are uncertain.

    """
    values = fit.values()
    if "offset" in values and values["offset"].excludes(0.0):
        yield Finding("force-offset", {"force": values["offset"].value})
    if fit.deviation > MAX_RESIDUAL_TO_NOISE:
        better = [name for name in unmodelled if set(unmodelled[name]) < set(unmodelled["A"])]
        yield Finding("misfit", {"ratio": fit.deviation, "unmodelled": unmodelled["A"], "better": better})
    if values["coulomb"].low <= 0:
        yield Finding("dry-friction-not-significant")
    max_speed = np.abs(samples.v).max(initial=0.0)
    if "velocity" in values and samples.v.size and values["velocity"].value > MAX_STRIBECK_VELOCITY_RATIO * max_speed:
        yield Finding("static-friction-uncertain")


def level_warnings(levels: Sequence[KineticFriction]) -> Iterator[Finding]:
    """Yield a warning where kinetic friction differs between recordings by more than both intervals.

    Args:
        levels: Kinetic friction of the recordings.

    Yields:
        The smallest and the largest friction in N.

    """
    if levels and max(k.friction.low for k in levels) > min(k.friction.high for k in levels):
        values = [k.friction.value for k in levels]
        yield Finding("levels-differ", {"lowest": min(values), "highest": max(values)})


def unmodelled_effects(model: Model, motions: Sequence[Motion]) -> dict[ModelName, tuple[str, ...]]:
    """List for each of the models A to F the effects on friction that it cannot represent in these recordings.

    Args:
        model: The pipeline's model.
        motions: The motions of the training recordings.

    Returns:
        Names of effects by model.

    """
    return {name: tuple(e.name for e in model.effects if not _represents(name, e, model, motions)) for name in TITLES}


def _represents(name: ModelName, effect: Effect, model: Model, motions: Sequence[Motion]) -> bool:
    ports = [port for port in effect.ports if PORTS[port].balance == "friction"]
    return all(name in _representing_models(port, effect, model, motions) for port in ports)


def _representing_models(port: str, effect: Effect, model: Model, motions: Sequence[Motion]) -> set[str]:
    if port == "dry_rise" and any("slowing" in e.ports for e in model.effects):  # then it is one branch's, as in D
        return MODELS_BY_PORT[port] | BY_BRANCH
    if port == "dry_factor" and _by_direction_alone(effect, model, motions):
        return BY_DIRECTION
    return MODELS_BY_PORT.get(port, NO_MODEL)


def _by_direction_alone(effect: Effect, model: Model, motions: Sequence[Motion]) -> bool:
    """Return whether the factor on dry friction is one number for each direction wherever the piston moved."""
    ambient, values = model.rig.ambient_pressure, model.effect_parameters(effect)
    for direction in (1.0, -1.0):
        factors = [
            effect.ports["dry_factor"](direction, *state, ambient, *values)
            for motion in motions
            for state in _sampled_states(motion, ambient)
        ]
        if factors and np.ptp(np.array(factors, dtype=np.float64)) > 0.0:
            return False
    return True


def _sampled_states(motion: Motion, ambient: float) -> list[tuple[float, float, float]]:
    """Return some positions and pressures p1, p2 of the moving piston."""
    indices = np.flatnonzero(motion.moving)
    indices = indices[:: max(1, indices.size // MAX_STATES)]
    p1, p2 = (
        motion.recording[n][indices] if n in motion.recording else np.full(indices.size, ambient) for n in ("p1", "p2")
    )
    return [(float(x), float(a), float(b)) for x, a, b in zip(motion.x[indices], p1, p2, strict=True)]
