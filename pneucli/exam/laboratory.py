"""A laboratory writes a folder: the recordings of one virtual rig and the pipeline file that describes them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.exam.rig.excitations import (
    MotionMachine,
    RowSensors,
    SteadyRows,
    measure_rows,
    simulate_imposed_motion,
    simulate_steady_rows,
)
from pneucli.exam.rig.parameters import FIVE_THREE, ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.sensors import Sensors, measure
from pneucli.exam.rig.simulation import Excitation, command_stamps, simulate_rig

# column, factor from SI, decimals
CSV_COLUMNS = {
    "u": ("U_valve [V]", 1.0, 4),
    "u2": ("U_valve_2 [V]", 1.0, 4),
    "p_supply": ("P_supply [bar]", 1e-5, 5),
    "p1": ("P1 [bar]", 1e-5, 5),
    "p2": ("P2 [bar]", 1e-5, 5),
    "x": ("Pos [mm]", 1e3, 3),
    "a": ("Acc [m/s2]", 1.0, 4),
    "force": ("F [N]", 1.0, 4),
    "flow": ("Q [l/min ANR]", 60e3 / 1.185, 3),  # ISO 8778: 1.185 kg/m^3
}
TIME, COMMAND_TIME = "t [ms]", "t_cmd [ms]"
Experiment = Literal["valve", "friction", "axis", "flow"]

SIGNALS: dict[Experiment, tuple[str, ...]] = {
    "valve": ("u", "p_supply", "p1"),
    "friction": ("p1", "p2", "x", "a"),
    "axis": ("u", "u2", "p_supply", "p1", "p2", "x", "a"),
    "flow": ("u", "p_supply", "p1", "flow"),
}
IMPOSED_MOTION_SIGNALS = ("p1", "x", "force")
GRAVITY = 9.81  # m/s^2


def write_csv(
    path: Path,
    rig: str,
    measured: dict[str, Array],
    signals: tuple[str, ...],
    position_step: float,
    commands: dict[str, Array] | None = None,
) -> None:
    """Write these signals (SI) with two comment lines and a header; positions are rounded to ``position_step`` (m).

    ``commands`` have a ``time`` (s) of their own and stand in columns of their own, which end early. Without a
    ``time`` in ``measured`` the rows have no clock.
    """
    columns: dict[str, list[str]] = {}
    if "time" in measured:
        columns[TIME] = _stamps(measured["time"])
    for name in signals:
        source = measured if commands is None or name not in commands else commands
        columns[CSV_COLUMNS[name][0]] = _values(name, source[name], position_step)
    if commands is not None:
        columns[COMMAND_TIME] = _stamps(commands["time"])
    rows = map(",".join, zip_longest(*columns.values(), fillvalue=""))
    lines = [f"# rig {rig}", f"# run {path.stem}", ",".join(columns), *rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _stamps(time: Array) -> list[str]:
    return [repr(value) for value in np.round(time * 1e3, 6).tolist()]


def _values(name: str, values: Array, position_step: float) -> list[str]:
    _, factor, decimals = CSV_COLUMNS[name]
    if name == "x":
        decimals = max(decimals, math.ceil(-math.log10(position_step * factor)))
    return [repr(value) for value in (np.round(values * factor, decimals) + 0.0).tolist()]


@dataclass(frozen=True)
class RecordingPlan:
    """One recording to be made: its name, its use, and the excitation of the rig."""

    name: str
    experiment: Experiment
    use: Literal["train", "test"]
    excitation: Excitation | MotionMachine | SteadyRows
    chamber: Literal[1, 2] = 1  # in a valve test: the chamber whose valve or port is tested
    weight: float = 0.0  # N toward +x, of a weight that hangs on the piston; it moves with it

    @property
    def is_imposed(self) -> bool:
        """Whether a machine imposes the motion."""
        return isinstance(self.excitation, MotionMachine)


@dataclass(frozen=True)
class Laboratory:
    """One rig, its sensors, and the contents of its pipeline file.

    Attributes:
        vessel_volume: The volume (m^3) of the vessel of the valve test; None where there is no such test.
        has_cylinder: Whether there is a cylinder.
        supply_recorded: Whether the files contain p_supply.
        effects: The effects in the pipeline file.
        stated_null: The valve's null in the pipeline file.
        stated_stroke: The stroke (m) in the pipeline file, where it is not exact.
        absent_signals: The signals that are not recorded.
        command_cycle: The controller gives a command in every n-th period of the loop; above 1 its log has a clock of
            its own.
        supply_start: The stall pressure (Pa, absolute) that a pump's data sheet states, in place of a supply pressure.
        source: What fills the chamber, where the pipeline file states it.

    """

    name: str
    parameters: Parameters
    sensors: Sensors
    vessel_volume: float | None = None
    has_cylinder: bool = True
    supply_recorded: bool = True
    linear_valve: bool = False
    effects: tuple[str, ...] = ()
    stated_null: str | None = None
    stated_stroke: float | None = None
    absent_signals: frozenset[str] = frozenset()
    command_cycle: int = 1
    supply_start: float | None = None
    source: str | None = None

    def valve_test_rig(self, chamber: Literal[1, 2] = 1) -> Parameters:
        """Return the rig of a valve test: this valve, supply and sensors on the vessel, no leak of the cylinder."""
        par = self.parameters._replace(piston_area_1=0.0, piston_area_2=0.0, dead_volume_1=self.vessel_volume or 0.0)
        par = par._replace(dead_volume_added=0.0, piston_leak_area=0.0, load_mass=0.0, arrangement=ONE_CHAMBER)
        par = par._replace(line_delay_1=0.0, line_delay_2=0.0)  # the vessel stands at the valve
        if chamber == 2:
            edges = {"effective_area": par.effective_area_2, "overlap": par.overlap_2, "exponent": par.exponent_2}
            is_one_spool = self.parameters.arrangement == FIVE_THREE
            par = par._replace(command_sign=-1.0 if is_one_spool else 1.0, **edges)
        tight = par._replace(leak_area=0.0, laminar_conductance=0.0, relief_growth=0.0)
        return tight if self.has_cylinder else par

    def signals(self, take: RecordingPlan) -> tuple[str, ...]:
        """Return the signals of a recording."""
        absent = set(self.absent_signals)
        if not self.supply_recorded and take.experiment != "flow":
            absent.add("p_supply")
        if self.parameters.arrangement != TWO_VALVES:
            absent.add("u2")
        recorded = IMPOSED_MOTION_SIGNALS if take.is_imposed else SIGNALS[take.experiment]
        return tuple(signal for signal in recorded if signal not in absent)

    def record(self, folder: Path, plans: Sequence[RecordingPlan], rng: np.random.Generator) -> dict[str, float]:
        """Simulate every recording and write ``folder/NAME.csv``; return the share of its time at the ends."""
        at_ends = {}
        for take in plans:
            path = folder / f"{take.name}.csv"
            if isinstance(take.excitation, SteadyRows):
                rows = simulate_steady_rows(self.parameters, take.excitation)
                seen = measure_rows(self.parameters, RowSensors(), rows, rng)
                write_csv(path, self.name, seen, self.signals(take), self.sensors.position_step)
                continue
            truth = self._simulate(take)
            par, commands = self._rig_of(take), self._command_log(take, truth)
            seen = measure(par, self.sensors, truth, rng)
            write_csv(path, self.name, seen, self.signals(take), self.sensors.position_step, commands)
            if take.experiment != "valve":
                at_ends[take.name] = float(np.mean((truth["x"] <= 0.0) | (truth["x"] >= par.stroke)))
        return at_ends

    def _rig_of(self, take: RecordingPlan) -> Parameters:
        if take.experiment == "valve":
            return self.valve_test_rig(take.chamber)
        par = self.parameters
        force, mass = par.constant_force - take.weight, par.mass + abs(take.weight) / GRAVITY
        return par._replace(constant_force=force, mass=mass) if take.weight else par

    def _simulate(self, take: RecordingPlan) -> dict[str, Array]:
        par, rate = self._rig_of(take), self.sensors.sensor_rate
        if isinstance(take.excitation, MotionMachine):
            return simulate_imposed_motion(par, take.excitation, rate)
        assert isinstance(take.excitation, Excitation)
        return simulate_rig(par, replace(take.excitation, cycle=self.command_cycle), rate)

    def _command_log(self, take: RecordingPlan, truth: dict[str, Array]) -> dict[str, Array] | None:
        """Return the commands with the stamps of the controller; None where the logger has them with the rest."""
        if self.command_cycle == 1 or not isinstance(take.excitation, Excitation):
            return None
        excitation = replace(take.excitation, cycle=self.command_cycle)
        stamps, samples = command_stamps(excitation, self.sensors.sensor_rate)
        return {"time": stamps, "u": truth["u"][samples], "u2": truth["u2"][samples]}

    def pipeline(self, plans: Sequence[RecordingPlan], folder: str, checks: str = "") -> str:
        """Return the pipeline file's text; ``folder`` is that of the recordings, relative to it."""
        parts = [
            "# measurements of one rig: its columns, and the stated values of the rig",
            f'[pipeline]\nname = "{self.name}"\n',
            self._rig(),
            self._columns(plans),
            *(self._recording(take, folder) for take in plans),
            self._model(plans),
        ]
        return "\n".join(parts) + checks

    def _rig(self) -> str:
        par = self.parameters
        stroke = self.stated_stroke or par.stroke
        # with an inexact stroke, the volume was measured at the other end
        dead_volume_2 = par.dead_volume_2 + par.piston_area_2 * (par.stroke - stroke)
        text = f'[rig]\ngas_temperature = "{par.temperature} K"\n'
        text += f'ambient_pressure = "{par.ambient / 1e5:.3f} bar"      # absolute\n'
        if self.supply_start is None or self.source is not None:
            setting = par.supply if self.supply_start is None else self.supply_start
            text += f'supply_pressure = "{setting / 1e5:.4f} bar"     # absolute; the regulator\'s setting\n'
        if self.has_cylinder:
            text += (
                f'\n[rig.cylinder]\npiston_area_1 = "{_number(par.piston_area_1 * 1e4, 4)} cm^2"\n'
                f'piston_area_2 = "{_number(par.piston_area_2 * 1e4, 4)} cm^2"\n'
                f'stroke = "{_number(stroke * 1e3, 1)} mm"\n'
                f'dead_volume_1 = "{_number(par.dead_volume_1 * 1e6, 3)} cm^3"\n'
                f'dead_volume_2 = "{_number(dead_volume_2 * 1e6, 3)} cm^3"\n'
                f'moving_mass = "{_number(par.mass, 4)} kg"\n'
            )
        if self.vessel_volume is not None:
            text += f'\n[rig.vessel]\nvolume = "{_number(self.vessel_volume * 1e6, 3)} cm^3"\n'
        if self.source in ("pump", "ejector"):
            text += f'\n[rig.source]\nkind = "{self.source}"\n'
        return text + self._valve()

    def _valve(self) -> str:
        """Return the table of the valve; "" for the usual one, the default of the pipeline file."""
        par = self.parameters
        lines = {
            "arrangement": {FIVE_THREE: "5/3", TWO_VALVES: "two"}.get(par.arrangement),
            "null": self.stated_null,
            "kind": "switching" if par.switching else "pressure" if self.source == "regulated" else None,
        }
        if par.switching and par.arrangement == ONE_CHAMBER:
            lines["arrangement"] = "one-chamber"
        entries = [f'{key} = "{value}"' for key, value in lines.items() if value]
        return "\n".join(["\n[rig.valve]", *entries]) + "\n" if entries else ""

    def _columns(self, takes: Sequence[RecordingPlan]) -> str:
        recorded = {signal for take in takes for signal in self.signals(take)}
        units = {"u": "V", "u2": "V", "x": "mm", "a": "m/s^2", "force": "N", "flow": "l/min ANR"}
        lines = ["[signals]", f'time = {{ column = "{TIME}", unit = "ms" }}']
        clock = f', time = {{ column = "{COMMAND_TIME}", unit = "ms" }}, hold = true'
        for name, (column, _, _) in CSV_COLUMNS.items():
            if name in recorded:
                unit = f'unit = "{units[name]}"' if name in units else 'unit = "bar", reference = "gauge"'
                own = clock if name in ("u", "u2") and self.command_cycle > 1 else ""
                lines.append(f'{name} = {{ column = "{column}", {unit}{own} }}')
        return "\n".join(lines) + "\n"

    def _recording(self, take: RecordingPlan, folder: str) -> str:
        text = f'[[recordings]]\nname = "{take.name}"\nfile = "{folder}/{take.name}.csv"\n'
        text += f'experiment = "{take.experiment}"\nuse = "{take.use}"\n'
        if take.experiment in ("friction", "axis"):
            if take.is_imposed:
                return text + 'imposed = "motion"\nchamber_2 = "open"\n'
            follows = self.parameters.arrangement != ONE_CHAMBER
            is_open = not isinstance(take.excitation, Excitation) or take.excitation.chamber_2_open
            state = "open" if is_open else "valve" if follows else "closed"
            known = f'force = "{take.weight:.4g} N"\n' if take.weight else ""
            return text + f'chamber_2 = "{state}"\n' + known
        clock = () if take.experiment == "flow" else ("time",)
        names = ", ".join(f'"{signal}"' for signal in (*clock, *self.signals(take)))
        return text + ("chamber = 2\n" if take.chamber == 2 else "") + f"take = [{names}]\n"

    def _model(self, takes: Sequence[RecordingPlan]) -> str:
        horizon = "5 s" if all(take.experiment == "valve" for take in takes) else "0.5 s"
        effects = ", ".join(f'"{effect}"' for effect in self.effects)
        valve = 'valve = "linear"\n' if self.linear_valve else ""
        known = ""
        if self.supply_start is not None and self.source is None:  # of a pump, from its data sheet
            known = f'\n[model.parameters]\n"rig.supply_pressure" = {{ start = "{self.supply_start / 1e5:.1f} bar" }}\n'
        return f'[model]\neffects = [{effects}]\n{valve}{known}\n[compare]\nhorizon = "{horizon}"\n'


def _number(value: float, decimals: int) -> str:
    """Format with this many decimals, and with more where fewer than four digits would remain."""
    return f"{value:.{max(decimals, 3 - math.floor(math.log10(value)))}f}"
