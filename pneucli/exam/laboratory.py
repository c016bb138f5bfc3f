"""A laboratory hands over a folder: the recordings of one virtual rig and the pipeline file that describes them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pneucli.exam.rig.files import LAYOUT, write_csv
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.run import Manoeuvre, run
from pneucli.exam.rig.sensors import Sensors, measure

Experiment = Literal["valve", "friction", "axis"]

SIGNALS: dict[Experiment, tuple[str, ...]] = {
    "valve": ("u", "p_supply", "p1"),
    "friction": ("p1", "p2", "x", "a"),
    "axis": ("u", "p_supply", "p1", "p2", "x", "a"),
}


@dataclass(frozen=True)
class Take:
    """One recording to be made: its name, where it is used, and what is done to which rig."""

    name: str
    experiment: Experiment
    use: Literal["train", "test"]
    manoeuvre: Manoeuvre

    @property
    def chamber_2(self) -> str | None:
        """``open`` or ``closed``; None on the bench, which has none."""
        if self.experiment == "valve":
            return None
        return "open" if self.manoeuvre.chamber_2_open else "closed"


@dataclass(frozen=True)
class Laboratory:
    """One rig, its sensors, and what its pipeline file says (volumes in m^3).

    ``vessel`` is the fixed chamber of the valve's bench, ``has_cylinder`` whether there is a cylinder; without
    ``supply_recorded`` the files have no p_supply; ``effects`` are those that the pipeline already knows of.
    """

    name: str
    parameters: Parameters
    sensors: Sensors
    vessel: float | None = None
    has_cylinder: bool = True
    supply_recorded: bool = True
    linear_valve: bool = False
    effects: tuple[str, ...] = ()

    @property
    def bench(self) -> Parameters:
        """The same valve, supply and sensors on the vessel; a leak of the cylinder stays with the cylinder."""
        par = self.parameters._replace(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=self.vessel or 0.0)
        par = par._replace(dead_volume_added=0.0, piston_leak_area=0.0, load_mass=0.0)
        return par._replace(leak_area=0.0) if self.has_cylinder else par

    def signals(self, experiment: Experiment) -> tuple[str, ...]:
        """The recorded signals of an experiment."""
        return tuple(s for s in SIGNALS[experiment] if s != "p_supply" or self.supply_recorded)

    def record(self, folder: Path, takes: Sequence[Take], rng: np.random.Generator) -> None:
        """Simulate every take and write ``folder/NAME.csv``."""
        for take in takes:
            par = self.bench if take.experiment == "valve" else self.parameters
            seen = measure(par, self.sensors, run(par, take.manoeuvre, self.sensors.fine_rate), rng)
            names = self.signals(take.experiment)
            write_csv(folder / f"{take.name}.csv", self.name, seen, names, self.sensors.position_step)

    def pipeline(self, takes: Sequence[Take], folder: str, checks: str = "") -> str:
        """Return the pipeline file's text; ``folder`` is where its recordings lie, relative to it."""
        parts = [
            "# measurements of one rig; what each column is, and what is known of the rig",
            f'[pipeline]\nname = "{self.name}"\n',
            self._rig(),
            self._columns(takes),
            *(_recording(take, folder, self.signals(take.experiment)) for take in takes),
            self._model(takes),
        ]
        return "\n".join(parts) + checks

    def _rig(self) -> str:
        par = self.parameters
        text = f'[rig]\ngas_temperature = "{par.temperature} K"\n'
        text += f'ambient_pressure = "{par.ambient / 1e5:.3f} bar"      # absolute\n'
        text += f'supply_pressure = "{par.supply / 1e5:.4f} bar"     # absolute; the regulator\'s setting\n'
        if self.has_cylinder:
            text += (
                f'\n[rig.cylinder]\npiston_area_1 = "{_number(par.piston_area_1 * 1e4, 4)} cm^2"\n'
                f'piston_area_2 = "{_number(par.piston_area_2 * 1e4, 4)} cm^2"\n'
                f'stroke = "{_number(par.stroke * 1e3, 1)} mm"\n'
                f'dead_volume_1 = "{_number(par.dead_volume_1 * 1e6, 3)} cm^3"\n'
                f'dead_volume_2 = "{_number(par.dead_volume_2 * 1e6, 3)} cm^3"\n'
                f'moving_mass = "{_number(par.mass, 4)} kg"\n'
            )
        if self.vessel is not None:
            text += f'\n[rig.vessel]\nvolume = "{_number(self.vessel * 1e6, 3)} cm^3"\n'
        return text

    def _columns(self, takes: Sequence[Take]) -> str:
        recorded = {signal for take in takes for signal in self.signals(take.experiment)}
        units = {"u": "V", "x": "mm", "a": "m/s^2"}
        lines = ["[signals]", 'time = { column = "t [ms]", unit = "ms" }']
        for name, (column, _, _) in LAYOUT.items():
            if name in recorded:
                unit = f'unit = "{units[name]}"' if name in units else 'unit = "bar", reference = "gauge"'
                lines.append(f'{name} = {{ column = "{column}", {unit} }}')
        return "\n".join(lines) + "\n"

    def _model(self, takes: Sequence[Take]) -> str:
        horizon = "5 s" if all(take.experiment == "valve" for take in takes) else "0.5 s"
        effects = ", ".join(f'"{effect}"' for effect in self.effects)
        valve = 'valve = "linear"\n' if self.linear_valve else ""
        return f'[model]\neffects = [{effects}]\n{valve}\n[compare]\nhorizon = "{horizon}"\n'


def _number(value: float, decimals: int) -> str:
    """As many decimals as given, and more where fewer than four digits would be left."""
    return f"{value:.{max(decimals, 3 - math.floor(math.log10(value)))}f}"


def _recording(take: Take, folder: str, signals: tuple[str, ...]) -> str:
    text = f'[[recordings]]\nname = "{take.name}"\nfile = "{folder}/{take.name}.csv"\n'
    text += f'experiment = "{take.experiment}"\nuse = "{take.use}"\n'
    if take.chamber_2:
        return text + f'chamber_2 = "{take.chamber_2}"\n'
    names = ", ".join(f'"{signal}"' for signal in ("time", *signals))
    return text + f"take = [{names}]\n"
