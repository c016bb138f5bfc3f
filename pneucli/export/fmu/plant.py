"""The plant that is exported: the identified rig with its effects, its inputs, its start, and its parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pneucli.arrays import Array
from pneucli.errors import InputError
from pneucli.physics.declaration import Effect
from pneucli.simulate import layout as at
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.kernel_settings import max_motion_step
from pneucli.simulate.model import Model
from pneucli.simulate.open_loop import SAMPLING_PERIOD, command_recording
from pneucli.simulate.preparation import prepare
from pneucli.simulate.run import area_tables, base_vector

Interval = tuple[float, float]

FAR = 1e9  # m: an end of the stroke that is nowhere; C has no literal for infinity
REFUSED_PORTS = dict.fromkeys(
    ("sensor_delay", "force_delay"), "it delays the recorder's channels against each other, not the plant"
)


@dataclass(frozen=True)
class Plant:
    """A plant with all its numbers, SI.

    Attributes:
        name: Name of the pipeline.
        effects: Effects that act, in the order of their parameters in ``th``.
        base: Base parameters in the order of :data:`pneucli.simulate.layout.BASE_NAMES`, shape (19,).
        th: Values by EFFECT.PARAMETER, in the unit of the catalogue.
        flags: Switches in the kernel's layout, shape (9,).
        areas: Effective areas in m^2 of the valve at chamber 1 over the command.
        areas_2: Those of chamber 2.
        max_step: Longest step of the equations in s.
        intervals: 95 % interval of identified parameters, by name.
    """

    name: str
    effects: tuple[Effect, ...]
    base: Array
    th: Mapping[str, float]
    flags: Array
    areas: Array
    areas_2: Array
    max_step: float
    intervals: Mapping[str, Interval]

    @property
    def has_cylinder(self) -> bool:
        """Whether there is a piston; otherwise the plant is the vessel of a valve test."""
        return bool(self.flags[at.MECHANICS] > 0.0)

    @property
    def inputs(self) -> dict[str, float]:
        """The inputs with their start, in the order of the layout: those that act on this plant."""
        null, supply = (float(self.base[at.BASE_NAMES.index(n)]) for n in ("valve.null", "rig.supply_pressure"))
        start = {"u": null, "u2": null, "p_supply": supply, "force": 0.0}
        acts = {
            "u2": self.flags[at.CHAMBER_2] == at.VALVE_2,
            "p_supply": self.flags[at.STATED_SUPPLY] == 0.0,
            "force": self.has_cylinder,
        }
        return {name: value for name, value in start.items() if acts.get(name, True)}

    @property
    def start(self) -> dict[str, float]:
        """The default start: at rest in mid-stroke at ambient pressure, the valve shut."""
        stroke, ambient = (float(self.base[at.BASE_NAMES.index(n)]) for n in ("rig.stroke", "rig.ambient_pressure"))
        centre = 0.5 * stroke if self.has_cylinder and math.isfinite(stroke) else 0.0
        return {"x": centre, "v": 0.0, "p1": ambient, "p2": ambient, "u": 0.0, "u2": 0.0}


def plant_of(
    name: str, model: Model, experiments: Sequence[Experiment], intervals: Mapping[str, Interval], where: str
) -> Plant:
    """Return the plant of an identified model.

    Args:
        name: Name of the pipeline.
        model: The identified model.
        experiments: Its experiments; those with the valve say what closes chamber 2, whether the supply pressure is an
            input, and where the ends of the stroke are.
        intervals: 95 % interval of identified parameters, by name.
        where: The place of the model in the pipeline file, for messages.

    Returns:
        The plant; an axis where the rig has a cylinder, else the vessel of its valve test.

    Raises:
        InputError: An effect cannot be exported.
    """
    kind = "axis" if model.rig.has_cylinder else "valve"
    own = [e for e in experiments if e.recording.kind.valve and e.recording.kind.vessel != model.rig.has_cylinder]
    imagined = _imagined(kind, model, own)
    flags = imagined.flags
    flags[at.U_MAX] = max(float(e.flags[at.U_MAX]) for e in experiments if e.recording.kind.valve)
    flags[at.STATED_SUPPLY] = float(all("p_supply" not in e.recording for e in own or experiments))
    acting = set((own[0] if own else imagined).active_effects(model.effects))
    effects = tuple(sorted((e for e in model.effects if e.name in acting), key=lambda e: (e.order, e.name)))
    for effect in effects:
        _require_exportable(effect, where)
    base = np.clip(base_vector(model, imagined), -FAR, FAR)
    supply = at.BASE_NAMES.index("rig.supply_pressure")
    if not math.isfinite(base[supply]):
        base[supply] = max(float(np.median(e.raw["p_supply"])) for e in own if "p_supply" in e.raw)
    values = model.effect_values()
    return Plant(
        name,
        effects,
        base,
        {f"{e.name}.{p.name}": values[f"{e.name}.{p.name}"] for e in effects for p in e.parameters},
        flags,
        *area_tables(model, imagined),
        min((e.max_step for e in own), default=max_motion_step(model.rig, SAMPLING_PERIOD)),
        intervals,
    )


def require_valve(experiments: Sequence[Experiment], where: str) -> None:
    """Raise InputError where no recording has a valve that lets gas through.

    Args:
        experiments: The experiments.
        where: The place of the recordings in the pipeline file.
    """
    if not any(e.recording.kind.valve and not e.recording.valve_shut for e in experiments):
        found = "no recording shows a valve that lets gas through: all are of friction, or of a valve that is shut"
        wanted = 'a recording with experiment = "valve" or "axis"'
        raise InputError(where, found, wanted, "add one under [[recordings]]", code="E071")


def _imagined(kind: str, model: Model, own: Sequence[Experiment]) -> Experiment:
    """Return an experiment at rest on this rig, with the ends of the stroke that the recordings show."""
    drives_both = model.rig.arrangement.drives_both
    stated = own[0].recording.chamber_2 if own else None
    chamber_2 = "valve" if drives_both else stated or "closed"
    command = np.full(10, model.rig.valve_null)
    about = {"experiment": kind, "chamber_2": chamber_2}
    limits = next((e.stroke_limits for e in own if e.stroke_limits is not None), None)
    return replace(prepare(command_recording(command, about, model.rig), model.rig, None), stroke_limits=limits)


def _require_exportable(effect: Effect, where: str) -> None:
    for port, reason in REFUSED_PORTS.items():
        if port in effect.ports:
            found = f'the effect "{effect.name}" cannot be exported: {reason}'
            raise InputError(
                where, found, "effects of the plant", f"pneucli remove PIPELINE {effect.name}", code="E064"
            )
