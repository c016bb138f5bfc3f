"""Identify friction from recordings of a cylinder (thesis chapter 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.errors import InputError
from pneucli.identify.friction.binned_curve import FrictionCurve, curve
from pneucli.identify.friction.imposed_motion import KineticFriction, kinetic_friction
from pneucli.identify.friction.kinematics import Motion, motion_of
from pneucli.identify.friction.model_error import Deviation, Replay, deviations, replays
from pneucli.identify.friction.models_a_to_f import GRID, Domain, FrictionModel, Name, identify_models
from pneucli.identify.friction.regression import FittedLaw, fit_coulomb, fit_stribeck
from pneucli.identify.friction.samples import Samples, Value, pool
from pneucli.identify.friction.stick_slip import Averaged, Cut, average, cut
from pneucli.identify.friction.summary_figures import (
    BreakAway,
    OverPressure,
    Repeats,
    break_away,
    over_pressure,
    repeats,
)
from pneucli.identify.friction.unmodelled_effects import lacking
from pneucli.messages.formatting import number, quantity
from pneucli.recording import Recording
from pneucli.simulate.model import Model

FEWEST = 100  # moving samples
RESTLESS = 1.5  # times the sensors' noise, beyond which the residual of model A is not noise
UNKNOWN = 0.5  # half the interval of an identified mass over its value, beyond which it counts as not identifiable


@dataclass(frozen=True)
class FrictionIdentification:
    """All that the friction tests tell.

    ``mass`` (kg) as given (interval of no width) or identified; None where it can't be: inertia is then neglected and
    a22 of the TP models is that of 1 kg. ``parameters``: model A's, with ``offset``, the constant force beside friction
    (N, positive where it pushes toward x = 0). ``models`` A to F (A to C where only one branch was measured).
    ``deviations`` are the tables 6.2 and 6.3, ``replays`` one slip under each model; they, ``kinetic`` friction,
    ``break_aways``, growth ``over_pressure`` and ``repeats`` have the test recordings in them; all else rests on the
    training ones.
    ``taken_out`` names the effects of forces, mass and sensors that are no friction and were allowed for, ``lacking``
    for each of A to F the effects on friction that it cannot show.
    """

    mass: Value | None
    parameters: Mapping[str, Value]
    domain: Domain
    motions: tuple[Motion, ...]
    curves: tuple[FrictionCurve, ...]
    cuts: tuple[Cut, ...]
    averages: tuple[Averaged, ...]
    models: tuple[FrictionModel, ...]
    deviations: tuple[Deviation, ...]
    replays: tuple[Replay, ...]
    kinetic: tuple[KineticFriction, ...]
    break_aways: tuple[BreakAway, ...]
    over_pressure: OverPressure | None
    repeats: tuple[Repeats, ...]
    taken_out: tuple[str, ...]
    lacking: Mapping[Name, tuple[str, ...]]
    warnings: tuple[str, ...]

    @property
    def offset(self) -> float:
        """The constant force beside friction in N."""
        return self.parameters["offset"].value if "offset" in self.parameters else 0.0

    def model(self, name: str) -> FrictionModel:
        """Return a model by its letter; raises InputError where these recordings did not give it."""
        for one in self.models:
            if one.name == name:
                return one
        raise InputError("friction model", name, ", ".join(m.name for m in self.models))


def identify_friction(
    recordings: Sequence[Recording],
    model: Model,
    nodes: int | None = None,
    top: float | None = None,
    eta: float | None = None,
) -> FrictionIdentification:
    """Identify friction from the friction tests among ``recordings``, or, where there are none, from axis recordings.

    What the ``model`` states of forces, mass and sensors is taken out before and simulated beside. Of the TP models
    ``nodes`` is the number of grid points, ``top`` (m/s) the end of their velocities, by default the highest of the
    tests, ``eta`` (s/m) the steepness of the smoothed sign, by default what the sensors resolve. Fits the recordings of
    use ``train``. Raises InputError where there is none, where the drive or the motion was not recorded, or where
    hardly anything moves.
    """
    motions = tuple(motion_of(r, model) for r in _usable(recordings))
    train = [m for m in motions if m.recording.use == "train"]
    warnings: list[str] = []
    mass = _mass(train, warnings)
    inertia = mass.value if mass else 0.0
    samples, lacks = pool(train, inertia), lacking(model, train)
    if len(samples) < FEWEST:
        raise InputError("friction recordings", f"{len(samples)} moving samples", f"at least {FEWEST}", "move further")
    if not samples.both_directions:
        warnings.append("motion in one direction only: a constant force can't be told from dry friction")
    both = fit_stribeck(samples, offset=samples.both_directions)
    fastest = max(float(np.abs(m.v[m.valid]).max()) for m in motions)  # the models must go as fast as the tests do
    domain = Domain(top or fastest, max(m.floor for m in train), nodes or GRID, eta)
    models, missing = identify_models(samples, both, domain, inertia or 1.0)
    cuts = tuple(c for m in train if not m.imposed for c in cut(m, inertia))
    levels = tuple(k for m in motions if (k := kinetic_friction(m, inertia)))
    ambient, imposed = model.rig.ambient_pressure, {m.recording.name for m in motions if m.imposed}
    strokes = [k for k in levels if k.recording in imposed]  # of others the pressure changes as they move
    return FrictionIdentification(
        mass=mass,
        parameters=both.values(),
        domain=domain,
        motions=motions,
        curves=tuple(curve(samples, branch) for branch in ("accelerating", "slowing", "both")),
        cuts=cuts,
        averages=tuple(average(cuts)),
        models=models,
        deviations=deviations(models, motions, inertia),
        replays=replays(models, motions, cuts, inertia),
        kinetic=levels,
        break_aways=tuple(b for m in motions if (b := break_away(m))),
        over_pressure=over_pressure(strokes, ambient),
        repeats=tuple(repeats(strokes, ambient)),
        taken_out=train[0].beside.names,
        lacking={m.name: lacks[m.name] for m in models},
        warnings=(*warnings, *missing, *_doubts(both, samples, lacks), *_differing(strokes)),
    )


def _usable(recordings: Sequence[Recording]) -> list[Recording]:
    moving = [r for r in recordings if r.kind.cylinder]
    tests = [r for r in moving if not r.kind.valve] or moving
    if not any(r.use == "train" for r in tests):
        raise InputError("recordings", "no friction test to train on", 'experiment = "friction", use = "train"')
    return tests


def _mass(train: Sequence[Motion], warnings: list[str]) -> Value | None:
    """Return all mass that moves: given, or fitted together with Coulomb and viscous friction where it shows."""
    if given := train[0].beside.model.rig.moving_mass:
        mass = given + train[0].beside.mass
        return Value(mass, mass, mass, "kg")
    samples = pool(train, 0.0)
    fit = fit_coulomb(samples, offset=samples.both_directions, mass=True)
    found = fit.values()["mass"]
    if found.value and found.ci_high - found.value < UNKNOWN * found.value:
        return found
    if not all(m.imposed for m in train):
        raise InputError("rig.cylinder.moving_mass", "missing, and these recordings do not tell it", "the moving mass")
    warnings.append("the moving mass does not show in these recordings: inertia is neglected, a22 is that of 1 kg")
    return None


def _reason(lacks: Mapping[Name, tuple[str, ...]]) -> str:
    """Return why a function of velocity alone does not describe the friction, as far as the pipeline's model knows."""
    if not lacks["A"]:
        return (
            "something acts that neither A, a function of velocity alone, nor the pipeline's effects have; if D, E or "
            "F leave less, slowing differs from speeding up; else ask pneucli diagnose"
        )
    better = [name for name in lacks if set(lacks[name]) < set(lacks["A"])]
    told = f"; {' and '.join(better)} have more of it" if better else "; none of A to F has it"
    return f"A, a function of velocity alone, lacks {', '.join(lacks['A'])}, which the pipeline's model has{told}"


def _differing(levels: Sequence[KineticFriction]) -> list[str]:
    """Return a warning where kinetic friction differs between recordings by more than both intervals."""
    if not levels or max(k.friction.ci_low for k in levels) <= min(k.friction.ci_high for k in levels):
        return []
    values = [k.friction.value for k in levels]
    spread = f"{number(min(values), 3)} to {quantity(max(values), 'N', 3)}"
    return [f"kinetic friction differs between recordings ({spread}): model A pools them; see each one's own level"]


def _doubts(both: FittedLaw, samples: Samples, lacks: Mapping[Name, tuple[str, ...]]) -> list[str]:
    """Return what the user should know about the fit of model A."""
    out = []
    values = both.values()
    if "offset" in values and (values["offset"].ci_low > 0 or values["offset"].ci_high < 0):
        force = values["offset"].value
        otherwise = "or friction differs by direction, or a sensor or an area errs"
        out.append(f"a constant force of {quantity(force, 'N', 3)} acts beside friction ({otherwise})")
    if both.deviation > RESTLESS:
        out.append(f"model A leaves {both.deviation:.1f} times the sensors' noise of these forces: {_reason(lacks)}")
    if values["coulomb"].ci_low <= 0:
        out.append("dry friction is not told from zero")
    if "velocity" in values and samples.v.size and values["velocity"].value > 0.25 * np.abs(samples.v).max():
        out.append("the Stribeck velocity lies near the end of the measured velocities: static friction is uncertain")
    return out
