"""Part of ``init``: what was tried in the recordings of a kind, and what of the rig has to be known for it.

What no experiment can use is refused in one line that says why and what to record.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.experiments import ExperimentName
from pneucli.init.column_names import is_angle
from pneucli.init.file_groups import FileGroup
from pneucli.init.role_evidence import drive_by_direction
from pneucli.init.survey_types import Guess, Survey
from pneucli.messages.formatting import format_plain

POSITION_BINS = 20  # of the piston's position
MAX_CLOSED_DEVIATION = 0.2  # share of a closed chamber's deviation that the position does not explain
MIN_FALLING_SHARE = 0.6  # of the steps between tenths of a recording, in which the pressure of a shut chamber falls
MIN_PRESSURE_FALL = 0.2  # of its range
NOISE_RANGE_STEPS = 10.0  # steps between samples: white noise alone has a range of five

Line = tuple[str, str, str]  # key, value as TOML, comment


@dataclass(frozen=True)
class GuessedExperiment:
    """The experiment of a kind, and its other keys."""

    experiment: ExperimentName
    keys: Sequence[Line]

    def value_of(self, key: str) -> str:
        """Return what a key says, without quotes; empty where it is not there."""
        return next((value.strip('"') for name, value, _ in self.keys if name == key), "")


def guess_experiment(kind: FileGroup) -> GuessedExperiment:
    """Return what was tried in the recordings of a kind."""
    has = kind.signals.keys()
    if kind.steady:
        outlet: Line = ("p1", '"1.013 bar"', "CHECK one pressure is recorded: the outlet is open to ambient")
        return GuessedExperiment("flow", [outlet] * ("p1" not in has))
    if {"x", "u"} <= has and ("p1" in has or "force" not in has):
        return GuessedExperiment("axis", [*_chamber_2(kind)])
    if "x" in has:
        return GuessedExperiment("friction", [*_friction(kind)])
    return GuessedExperiment("valve", [*_command(kind)])


def _chamber_2(kind: FileGroup) -> Iterator[Line]:
    if kind.further_files:
        yield "chamber_2", '"closed"', 'CHECK or "open" (to ambient), or "valve"'
    elif "u2" in kind.signals:
        yield "chamber_2", '"valve"', "u2 is recorded"
    elif not {"p1", "p2"} & kind.signals.keys():
        yield "chamber_2", '"valve"', 'CHECK no pressure is recorded; or "open" (to ambient), or "closed"'
    elif "p2" not in kind.signals:
        yield "chamber_2", '"closed"', 'CHECK no p2 is recorded; or "open" (to ambient), or "valve"'
    elif np.ptp(kind.pooled_values("p2")) < 0.1 * np.ptp(kind.pooled_values("p1")):
        yield "chamber_2", '"open"', "p2 stays where it is"
    elif _depends_on_position(kind.pooled_values("p2"), kind.pooled_values("x")):
        yield "chamber_2", '"closed"', "p2 follows the piston's position, as a closed chamber's does"
    else:
        yield "chamber_2", '"valve"', "p2 moves also where the piston does not, so a valve moves it"


def _depends_on_position(values: Array, x: Array) -> bool:
    """Return whether ``values`` are a function of the position, but for a fifth of their deviation."""
    size = min(values.size, x.size)
    values, x = values[:size], x[:size]
    place = np.digitize(x, np.linspace(x.min(), x.max(), POSITION_BINS + 1)[1:-1])
    means = np.bincount(place, values, POSITION_BINS) / np.maximum(np.bincount(place, minlength=POSITION_BINS), 1)
    return bool(np.std(values - means[place]) < MAX_CLOSED_DEVIATION * np.std(values))


def _friction(kind: FileGroup) -> Iterator[Line]:
    if "force" in kind.signals or "p1" not in kind.signals:
        yield (
            "imposed",
            '"motion"',
            "the force is held against the motion; take it out where the force was what was set",
        )
    if "p1" in kind.signals and "p2" not in kind.signals:
        yield "chamber_2", '"open"', "CHECK no p2 is recorded"


def sign_conventions(kind: FileGroup) -> dict[str, str]:
    """Return which of force and position count the other way than chamber 1, with the evidence.

    Chamber 1 pushes toward +x. A force that grows with its pressure holds against it, so it is positive toward -x; and
    what drives a piston is larger where it moves toward its own positive side.
    """
    if not {"x", "p1", "force"} <= kind.signals.keys():
        return {}
    pressures, forces, places = (kind.values_per_file(name) for name in ("p1", "force", "x"))
    p, force = (np.array([np.median(values) for values in each]) for each in (pressures, forces))
    if p.size < 2 or not np.ptp(p) or not np.ptp(force):
        return {}
    against = np.corrcoef(p, force)[0, 1] > 0
    drags = [drag for f, x in zip(forces, places, strict=True) if (drag := drive_by_direction(f, x)) is not None]
    found = {"force": "CHECK it holds against p1, which pushes toward +x"} if against else {}
    if drags and (float(np.median(drags)) > 0) == against:
        found["x"] = "CHECK the force is larger where the piston moves against p1, so chamber 1 grows the other way"
    return found


def _command(kind: FileGroup) -> Iterator[Line]:
    if "u" in kind.signals:
        return
    if "p1" in kind.signals and _only_falls(kind):
        other = 'where it was emptied through an opening: u = "-10 V"'
        yield "valve", '"shut"', f"CHECK no command is recorded, and p1 only falls: a shut chamber that leaks? {other}"
    else:
        yield "u", '"? V"', "no command is recorded: the one that was held (above the valve's null it fills)"


def _only_falls(kind: FileGroup) -> bool:
    falls = []
    for values in kind.values_per_file("p1"):
        tenths = np.array([np.median(part) for part in np.array_split(values, min(10, values.size)) if part.size])
        falls += (np.diff(tenths) <= 0).tolist()
    return (
        bool(falls)
        and float(np.mean(falls)) >= MIN_FALLING_SHARE
        and all(values[-1] < values[0] for values in kind.values_per_file("p1"))
    )


def rig_tables(
    groups: Sequence[FileGroup], experiments: Sequence[GuessedExperiment]
) -> Iterator[tuple[str, list[Line]]]:
    """Yield the tables of the rig with what the recordings need; what is to be filled in has a ``?``.

    A key that starts with ``#`` may stay away.
    """
    valve_tests = [k for k, t in zip(groups, experiments, strict=True) if t.experiment == "valve"]
    axes = [k for k, t in zip(groups, experiments, strict=True) if t.experiment == "axis"]
    shut = all(t.value_of("valve") == "shut" for t in experiments if t.experiment == "valve")
    yield "rig", [*_environment_keys(groups, [*axes, *([] if shut else valve_tests)])]
    if valve_tests:
        unknown = "where it is not known, leaks and openings are stated per volume"
        yield (
            "rig.vessel",
            [("# volume" if shut else "volume", '"? l"', unknown if shut else "the vessel that is filled")],
        )
    if lines := [*_valve_keys(groups, experiments)]:
        yield "rig.valve", lines
    moved = [k for k in groups if "x" in k.signals and {"p1", "p2", "u"} & k.signals.keys()]
    if moved:
        yield "rig.cylinder", [*_cylinder_keys(moved, bool(axes))]


def _environment_keys(kinds: Sequence[FileGroup], driven: Sequence[FileGroup]) -> Iterator[Line]:
    yield "ambient_pressure", '"1.013 bar"', "absolute"
    yield "gas_temperature", '"293.15 K"', ""
    if any("p_supply" not in kind.signals for kind in driven):
        yield "supply_pressure", '"? bar"', "absolute; p_supply is not recorded"


def _valve_keys(kinds: Sequence[FileGroup], trials: Sequence[GuessedExperiment]) -> Iterator[Line]:
    driven = [kind for kind in kinds if "u" in kind.signals and {"p1", "x"} & kind.signals.keys() and not kind.steady]
    if any(t.value_of("chamber_2") == "valve" for t in trials):
        two = any("u2" in kind.signals for kind in kinds)
        why = "u2 is recorded" if two else "one command, and both chambers are driven"
        yield "arrangement", '"two"' if two else '"5/3"', why
    u = np.concatenate([kind.pooled_values("u") for kind in driven] or [np.zeros(1)])
    if np.unique(u).size == 2:
        yield "kind", '"switching"', "the command has two values"
    elif u.min() >= 0:
        shown = [(kind, "p1" if "p1" in kind.signals else "x") for kind in driven]
        falling = [name for kind, name in shown if any(_falls(values) for values in kind.values_per_file(name))]
        for name in falling[:1]:
            yield "null", '"identify"', f"{name} falls, although the command is never below {format_plain(u.min(), 3)}"


def _falls(values: Array) -> bool:
    """Return whether a pressure falls by more than a fifth of its range, spikes and noise aside."""
    low, high = np.percentile(values, (1.0, 99.0))
    if high - low < NOISE_RANGE_STEPS * float(np.median(np.abs(np.diff(values)))):
        return False
    after = values[int(np.argmax(values >= high)) :]
    return bool(np.percentile(after, 10.0) < high - MIN_PRESSURE_FALL * (high - low))


def _cylinder_keys(moved: Sequence[FileGroup], axes: bool) -> Iterator[Line]:
    rotary = any(is_angle(kind.signals["x"].unit) for kind in moved)
    area, length, mass = ("cm^3/rad", "deg", "kg m^2") if rotary else ("cm^2", "mm", "kg")
    yield "piston_area_1", f'"? {area}"', "on which p1 acts" + (", or pi/4 x bore squared" if not rotary else "")
    both = any("p2" in kind.signals for kind in moved) or axes
    yield (
        "piston_area_2" if both else "# piston_area_2",
        f'"? {area}"',
        "on which p2 acts; as piston_area_1 where absent",
    )
    if axes:
        yield "stroke", f'"? {length}"', "x = 0 where chamber 1 is smallest"
        read = all("p1" in kind.signals for kind in moved)
        shown = "of chamber 1 at x = 0, its hose included" + ("; identified where absent" if read else "")
        yield "# dead_volume_1" if read else "dead_volume_1", '"? cm^3"', shown
        known = all("p2" in kind.signals for kind in moved)  # else nothing tells how that gas pushes
        yield "# dead_volume_2" if known else "dead_volume_2", '"? cm^3"', "of chamber 2 at x = stroke"
    yield ("# moment_of_inertia" if rotary else "# moving_mass"), f'"? {mass}"', "identified where absent"


MAX_END_SAMPLES = 3  # samples at either end of a scaled column: a sensor that rests or clips has more there
MIN_LEVELS = 50  # different numbers of a column that may be scaled
SCALED_ENDS = ((0.0, 1.0), (-1.0, 1.0), (0.0, 100.0))
ROUNDING = 1e-6  # by which an end may miss its number
Z_MEAN, Z_DEVIATION = 0.01, 0.01  # by which mean and deviation of a z-score may miss 0 and 1, rounded to digits
SENSED = ("p1", "p2", "p_supply", "x", "v", "a", "force", "flow")


def refuse_unusable(survey: Survey, guesses: Sequence[Guess]) -> None:
    """Raise InputError where numbers were scaled, or rows are a friction map that no clock orders."""
    found = {one.signal: one for one in guesses if one.signal}
    scaled = {name: text for name in SENSED if name in found and (text := _scaled(found[name]))}
    if scaled:
        names = ", ".join(f'"{found[name].column.name or found[name].column.key}"' for name in scaled)
        raise InputError(
            str(survey.path),
            f"{names} {next(iter(scaled.values()))}: scaled numbers, in no unit",
            "readings in units, such as bar, mm and V",
            "export them as they were before they were scaled",
            code="E041",
        )
    timed = "time" in found or any(one.clock is not None for one in survey.columns)
    if {"v", "force"} <= found.keys() and not timed and not found.keys() & {"x", "p1", "flow"}:
        raise InputError(
            str(survey.path),
            "rows of velocity and force without a clock: a friction map",
            "recordings over time",
            "export the runs that it was made from: time, x or v, and the force or the pressures",
            code="E041",
        )


def _scaled(one: Guess) -> str:
    """Return how the numbers of a column were scaled; empty where they were not, or where the file says their unit."""
    values = one.column.finite_values
    if one.unit_stated or np.unique(values).size < MIN_LEVELS:
        return ""
    for low, high in SCALED_ENDS:
        if abs(float(values.min()) - low) < ROUNDING and abs(float(values.max()) - high) < ROUNDING:
            at_ends = max(_count_at(values, low), _count_at(values, high))
            return f"fills exactly {format_plain(low)} to {format_plain(high)}" if at_ends <= MAX_END_SAMPLES else ""
    is_score = abs(float(values.mean())) < Z_MEAN and abs(float(values.std()) - 1.0) < Z_DEVIATION
    return "has a mean of 0 and a deviation of 1" if is_score else ""


def _count_at(values: Array, level: float) -> int:
    return int(np.count_nonzero(np.abs(values - level) < ROUNDING))


def limits_of(groups: Sequence[FileGroup]) -> Iterator[str]:
    """Yield what cannot be identified from files in which neither a pressure nor a force was recorded."""
    for kind in groups:
        held = kind.signals.keys() & {"x", "v", "a"}
        if kind.steady or kind.signals.keys() & {"p1", "p2", "p_supply"} or (held and "force" in kind.signals):
            continue
        names = ", ".join(name for name in kind.signals if name != "time") or "no signal"
        wanted = "x beside the force" if "force" in kind.signals else "the force on the piston beside x"
        if {"u", "x"} <= kind.signals.keys():
            yield (
                f"{kind.surveys[0].path.name}: {names} and no pressure: friction and one gain of the valve show in "
                "ratio to supply pressure x piston area, neither a map of the valve nor a leak; record p1 for those"
            )
            continue
        yield (
            f"{kind.surveys[0].path.name}: {names} and no pressure: neither the valve's map nor friction can be "
            f"identified; record p1 (and p2, p_supply), or {wanted}"
        )
