"""Write a fleet of small rigs at several dates: a template, a table and, sealed, what changed in which rig.

Each rig is drawn as in an exam and recorded for some seconds at every date: the same test programme, new noise. Some
rigs differ at the last date: an effect of the catalogue appeared, or friction grew.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from functools import partial
from pathlib import Path

import numpy as np

from pneucli.exam.cases import SEALED_FOLDER, prepare_case
from pneucli.exam.conditions import Conditions
from pneucli.exam.hidden_effects import BY_NAME, RIGS_WITH_PISTON
from pneucli.exam.laboratory import RecordingPlan
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import Excitation

Rows = list[dict[str, str]]

FIRST_DATE = date(2026, 1, 1)
RECORDING_SAMPLES = {"stickslip": 3000, "driven": 2500}  # ms of a take
WEAR_PARAMETERS = ("friction.coulomb", "friction.viscous")
WEAR_FACTORS = (1.15, 1.5)  # times, of friction that wears
CHANGES = (*WEAR_PARAMETERS, *(e.name for e in BY_NAME.values() if e.kinds == RIGS_WITH_PISTON and not e.part))
TABLE_FILE, TEMPLATE_FILE, FLEET_FILE, TRUTH_FILE = "rigs.csv", "template.toml", "fleet.toml", "fleet.json"
STATED_KEYS = {
    "rig.supply_pressure": ("supply", 1e-5, "bar"),
    "rig.cylinder.piston_area_1": ("piston_area_1", 1e4, "cm^2"),
    "rig.cylinder.piston_area_2": ("piston_area_2", 1e4, "cm^2"),
    "rig.cylinder.dead_volume_1": ("dead_volume_1", 1e6, "cm^3"),
    "rig.cylinder.dead_volume_2": ("dead_volume_2", 1e6, "cm^3"),
    "rig.cylinder.moving_mass": ("mass", 1.0, "kg"),
}


@dataclass(frozen=True)
class FleetRig:
    """One rig: its number in the fleet, what changes at the last date, and by how much.

    ``drift`` is the relative standard deviation of its friction from date to date.
    """

    number: int
    changes: tuple[str, ...]
    size: float
    seed: int
    drift: float = 0.0

    @property
    def name(self) -> str:
        """Name of the rig."""
        return f"rig-{self.number:05d}"


MapFunction = Callable[[Callable[[FleetRig], Rows], Iterable[FleetRig]], Iterable[Rows]]


def write_fleet(
    directory: Path,
    rigs: int,
    dates: int = 2,
    changed: float = 0.05,
    size: float = 1.0,
    seed: int = 1,
    changes_per_rig: int = 1,
    drift: float = 0.0,
    map_function: MapFunction = map,
) -> dict[str, list[str]]:
    """Write table, template, fleet file and raw files; return the changes by rig, which are sealed as well.

    A share ``changed`` of the rigs (at least one, unless it is 0) has ``changes_per_rig`` changes of ``size`` times
    the usual. The friction of all rigs differs from date to date with the relative standard deviation ``drift``.
    ``map_function`` applies the recording to every rig: ``map``, or that of a pool of processes.
    """
    rng = np.random.default_rng(seed)
    number = max(round(changed * rigs), 1) if changed > 0 else 0
    chosen = {int(k): _draw_changes(rng, changes_per_rig) for k in rng.permutation(rigs)[:number]}
    axes = [FleetRig(k, chosen.get(k, ()), size, int(rng.integers(2**31)), drift) for k in range(rigs)]
    rows = [row for rig in map_function(partial(_record, directory, dates), axes) for row in rig]
    with (directory / TABLE_FILE).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (directory / TEMPLATE_FILE).write_text(_template(axes[0]), encoding="utf-8")
    fleet = f'[fleet]\nname = "{directory.name}"\ntemplate = "{TEMPLATE_FILE}"\ntable = "{TABLE_FILE}"\n'
    (directory / FLEET_FILE).write_text(fleet, encoding="utf-8")
    truth = {axis.name: list(axis.changes) for axis in axes if axis.changes}
    sealed = directory / SEALED_FOLDER / TRUTH_FILE
    sealed.parent.mkdir(parents=True, exist_ok=True)
    sealed.write_text(json.dumps(truth, indent=1), encoding="utf-8")
    return truth


def _draw_changes(rng: np.random.Generator, at_once: int) -> tuple[str, ...]:
    return tuple(map(str, np.atleast_1d(rng.choice(CHANGES, at_once if at_once > 1 else None, replace=False))))


def _record(directory: Path, dates: int, axis: FleetRig) -> Rows:
    case = prepare_case(axis.name, "friction", [], "", 1.0, axis.seed, Conditions())
    takes = [_shortened(take) for take in case.plans[:4]]
    rows = []
    for k in range(dates):
        is_last = k == dates - 1 and k > 0
        parameters = apply_changes(axis, case.laboratory.parameters) if is_last else case.laboratory.parameters
        parameters = _with_daily_scatter(axis, parameters, k)
        day = (FIRST_DATE + timedelta(days=k)).isoformat()
        folder = Path("raw") / axis.name / day
        laboratory = replace(case.laboratory, parameters=parameters)
        laboratory.record(directory / folder, takes, np.random.default_rng([axis.seed, 2, k]))
        rows.append(_row(axis, case.laboratory.parameters, day, folder, takes))
    return rows


def _shortened(take: RecordingPlan) -> RecordingPlan:
    samples, manoeuvre = RECORDING_SAMPLES[take.name.split("_")[0]], take.excitation
    assert isinstance(manoeuvre, Excitation)
    return replace(take, excitation=replace(manoeuvre, command=manoeuvre.command[:samples]))


def apply_changes(axis: FleetRig, par: Parameters) -> Parameters:
    """Return the rig with its changes."""
    rng = np.random.default_rng([axis.seed, 3])
    for change in axis.changes:
        if change in WEAR_PARAMETERS:
            field = change.partition(".")[2]
            par = par._replace(**{field: getattr(par, field) * (1.0 + axis.size * (rng.uniform(*WEAR_FACTORS) - 1.0))})
        else:
            par = BY_NAME[change].apply(par, axis.size, rng)
    return par


def _with_daily_scatter(axis: FleetRig, par: Parameters, day: int) -> Parameters:
    """Return the rig on a day: lubrication, temperature and rest differ from day to day."""
    rng = np.random.default_rng([axis.seed, 4, day])
    factors = {name.partition(".")[2]: float(np.exp(axis.drift * rng.standard_normal())) for name in WEAR_PARAMETERS}
    return par._replace(**{field: getattr(par, field) * factor for field, factor in factors.items()})


def _row(axis: FleetRig, par: Parameters, day: str, folder: Path, takes: Sequence[RecordingPlan]) -> dict[str, str]:
    stated = {key: f"{getattr(par, f) * factor:.4f} {unit}" for key, (f, factor, unit) in STATED_KEYS.items()}
    files = {f"recordings.{take.name}.file": f"{folder.as_posix()}/{take.name}.csv" for take in takes}
    return {"rig": axis.name, "date": day, **stated, **files}


def _template(axis: FleetRig) -> str:
    case = prepare_case("template", "friction", [], "", 1.0, axis.seed, Conditions())
    return case.laboratory.pipeline(_with_uses(case.plans[:4]), "raw")


def _with_uses(takes: Sequence[RecordingPlan]) -> list[RecordingPlan]:
    """Return the recordings with their uses: the last one of each experiment is held out."""
    uses: Mapping[str, str] = {"stickslip_2": "test", "driven_2": "test"}
    return [replace(take, use="test" if uses.get(take.name) else "train") for take in takes]
