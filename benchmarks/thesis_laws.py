"""The seven laws on five rigs, before and after: ``python -m benchmarks.thesis_laws [RIG...]``.

Each controller is designed from the exact model of a rig of the exam (fixtures/demo, and four with Stribeck friction)
and drives that rig, which shares no code with the model. Columns: largest error over the last half second at rest after
steps of 15 % of the stroke; largest motion at rest after steps and under a load; rms error of a sine of 0.5 Hz (15 % of
the stroke, or what the reference's largest speed allows); largest error at rest under 50 N (scaled by the area over
8 cm^2) and the time to reject it to 50 um; error of the load estimate over the load; the least share of samples in
sliding of the load and the flow observer.

``python -m benchmarks.thesis_laws --write`` also writes the table into ``docs/development/experiments.md``.

``before``: the sector from the identified model's eta and without a load estimate, and ``compensated`` with the bounds
M_k of ``best`` (0.05 of the valve's rate, a quarter of break-away friction).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import small
from benchmarks.laws import _make
from benchmarks.rigs import Trace, driven, model_of
from pneucli.closed_loop.metrics import OBSERVERS, ROUNDING
from pneucli.controller import layout
from pneucli.controller.laws import LAWS
from pneucli.controller.parameters import Controller
from pneucli.design.bandwidths import choose_bandwidths
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import controller_for, design_controllers, design_variants
from pneucli.design.design_data import DesignData, collect_design_data, sliding_surfaces
from pneucli.design.lpv import compare_weight_types
from pneucli.design.requirements import Requirements
from pneucli.design.sliding import axis_systems
from pneucli.exam.cases import prepare_case
from pneucli.exam.conditions import parse
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters
from pneucli.tp import WeightType

Array = NDArray[np.float64]
RIGS = ("demo", "usual", "two-valves", "differential+5/3", "bore-12mm")
SEED, SMALL_RIG = 1, "small"
STRIBECK_SIZE = 0.4  # of the catalogue's typical size
IDENTIFIED_ETA = 2.0 / 1.4e-4  # s/m: of the friction model that identify finds on fixtures/demo
PERIOD, DURATION, REST = 1e-3, 6.5, 500  # s, s, samples
PAGE = Path(__file__).parents[1] / "docs/development/experiments.md"
MARKS = ("<!-- made: benchmarks.thesis_laws -->", "<!-- end of benchmarks.thesis_laws -->")
STATES = {"load": layout.S_LOAD, "flow": layout.S_FLOW1}
HEAD = ("rig", "law", "rest, um", "cycle, um", "sine, um", "load, um", "rejected, s", "load estimate off", "sliding")


def rig(name: str) -> Parameters:
    """Return the parameters of a rig by its condition, or those of fixtures/demo or of small runs."""
    if name == SMALL_RIG:
        return small.laboratory().parameters
    if name == "demo":
        return next(f.laboratory for f in _make().fixtures() if f.laboratory.name == "demo").parameters
    return prepare_case("rig", "axis", ("stribeck",), "", STRIBECK_SIZE, SEED, parse(name)).laboratory.parameters


@cache
def design_data(par: Parameters, weight_types: tuple[WeightType, ...] = ("cno",)) -> DesignData:
    """Return the design data of a rig from its exact model; without a type of weights there is no PDC."""
    model = model_of(par, ("stribeck", *(("piston-leak",) if par.piston_leak_area > 0.0 else ())))
    closed = par.arrangement == ONE_CHAMBER
    wanted = Requirements(quantum_x=1e-6, noise_p=400.0, chamber_2="closed" if closed else "valve")
    cascade = design_cascade(model, wanted, float(np.sqrt(par.ambient * par.supply)) if closed else None)
    c = cascade.values
    bandwidths = choose_bandwidths(model, wanted, c, predicted=False)
    mechanical = axis_systems(c, 0.5 * c["C_STROKE"], c["C_P_MEAN"], c["C_P_MEAN"])["mechanical"]
    surfaces = sliding_surfaces(mechanical, bandwidths, wanted)
    return collect_design_data(cascade, bandwidths, wanted, surfaces, compare_weight_types(c, 0.05, weight_types), {})


def controllers(data: DesignData) -> Iterator[tuple[str, Controller]]:
    """Yield the controllers by title: all laws, their variants, and the laws as they were before."""
    yield from design_controllers(data)[0].items()
    yield from design_variants(data, LAWS).items()
    steep = controller_for("sector", replace(data, requirements=replace(data.requirements, eta=IDENTIFIED_ETA)))
    yield "sector, before", with_own(steep, C_LOAD_FILTER=0.0)
    bounds = {name: data.cascade.values[name] for name in ("C_LOAD_STEP_MAX", "C_FLOW_STEP_MAX")}
    yield "compensated, before", controller_for("compensated", data).with_values(**bounds)


def with_own(controller: Controller, **changed: float) -> Controller:
    """Return a controller with some own parameters of its law replaced."""
    names = LAWS[controller.law].parameters
    return replace(controller, own=tuple(changed.get(n, v) for n, v in zip(names, controller.own, strict=True)))


def figures(par: Parameters, controller: Controller) -> list[float]:
    """Return the figures of one controller on one rig, in the order of ``HEAD``."""
    time, middle = PERIOD * np.arange(round(DURATION / PERIOD)), 0.5 * par.stroke
    amplitude = min(0.15 * par.stroke, controller.values["C_V_MAX"] / np.pi)
    steps = middle + par.stroke * np.where(time < 0.5, 0.0, np.where(time < 3.5, 0.15, -0.15))
    sine = middle + amplitude * np.sin(np.pi * np.maximum(time - 0.5, 0.0))
    load = 50.0 * par.piston_area_1 / 8e-4 * ((time >= 1.0) & (time < 4.0))
    still, nothing = np.full(time.size, middle), np.zeros(time.size)
    runs = [
        driven(par, controller, reference, force)
        for reference, force in ((steps, nothing), (sine, nothing), (still, load))
    ]
    stepped, followed, loaded = (1e6 * (run.x - r) for run, r in zip(runs, (steps, sine, still), strict=True))
    rests = [stepped[3500 - REST : 3500], stepped[-REST:]]
    under = [loaded[4000 - REST : 4000], loaded[-REST:]]
    return [
        max(float(np.abs(e).max()) for e in rests),
        max(float(np.ptp(e)) for e in (*rests, *under)),
        float(np.sqrt(np.mean(followed[1500:] ** 2))),
        max(float(np.abs(e).max()) for e in under),
        rejection_time(loaded[1000:4000]),
        load_error(runs[2], load),
        min((sliding_share(run, controller, name) for run in runs for name in OBSERVERS), default=np.nan),
    ]


def rejection_time(error: Array) -> float:
    """Return the time in s after which an error (um) stays within 50 um; infinite: never."""
    outside = np.flatnonzero(np.abs(error) > 50.0)
    if not outside.size:
        return 0.0
    return np.inf if outside[-1] == error.size - 1 else PERIOD * float(outside[-1] + 1)


def load_error(run: Trace, load: Array) -> float:
    """Return the error of the load estimate at the end of the load, over the load, which pushes toward x = 0."""
    estimate = float(np.mean(run.states[4000 - REST : 4000, layout.S_LOAD]))
    return abs(estimate + load.max()) / load.max()


def sliding_share(run: Trace, controller: Controller, observer: str) -> float:
    """Return the share of samples in sliding of an observer; 1 for a law without it."""
    _, bound, low_pass = OBSERVERS[observer]
    law = LAWS[controller.law]
    if low_pass in law.constants:
        increment = controller.values[bound] * controller.vector()[law.constants[low_pass]]
    elif controller.values["C_DISTURBANCE_OBSERVERS"] > 0.5:
        increment = controller.values[bound]
    else:
        return 1.0
    return float(np.mean(np.abs(np.diff(run.states[:, STATES[observer]])) <= (1.0 - ROUNDING) * increment))


def table(names: list[str], *, is_small: bool = False) -> Iterator[str]:
    """Yield the lines of the table, a row for each rig and controller; small: for the first controller."""
    yield f"| {' | '.join(HEAD)} |"
    yield f"|{' --- |' * len(HEAD)}"
    for name in names:
        par = rig(name)
        data = design_data(par, ()) if is_small else design_data(par)
        for title, controller in islice(controllers(data), 1 if is_small else None):
            row = figures(par, controller)
            estimated = LAWS[controller.law].estimates_load
            shown = [f"{value:.3g}" for value in (row if estimated else row[:5])] + ["–"] * (0 if estimated else 2)
            yield f"| {name} | {title} | {' | '.join(shown)} |"


def main(arguments: list[str]) -> None:
    """Print the table; with ``--write`` put it between the marks of its page as well."""
    if small.SMALL in arguments:
        print("\n".join(table([SMALL_RIG], is_small=True)))
        return
    lines = []
    for line in table([name for name in arguments if name != "--write"] or list(RIGS)):
        print(line, flush=True)
        lines.append(line)
    if "--write" in arguments:
        before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
        _, _, after = rest.partition(MARKS[1])
        text = "\n".join([f"{before}{MARKS[0]}", "", *lines, "", f"{MARKS[1]}{after}"])
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
