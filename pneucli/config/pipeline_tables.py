"""Pydantic models of every table of the pipeline file; quantities become SI floats while they are checked."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, ValidationInfo, WithJsonSchema, model_validator

from pneucli.arrangements import ArrangementName
from pneucli.config.signal_tables import SignalName, SignalsTable, TextTable, parse_calibration
from pneucli.config.stage_tables import CheckTable, CompareTable, IdentifyTable, ModelTable, ParameterTable, PlanTable
from pneucli.config.value_types import (
    Acceleration,
    Angle,
    Area,
    Force,
    GasConstant,
    GaugePressure,
    HeatCapacityRatio,
    Instant,
    Length,
    Mass,
    MassFlow,
    Name,
    Position,
    Pressure,
    Stiffness,
    Table,
    Temperature,
    Velocity,
    Voltage,
    Volume,
)
from pneucli.errors import UnitError
from pneucli.experiments import EXPERIMENT_KINDS, ExperimentKind
from pneucli.experiments import ExperimentName as Experiment
from pneucli.gases import GASES, GasName
from pneucli.quantities import ROTARY_UNITS, SIGNALS
from pneucli.recording import Calibration, Rig, Use
from pneucli.units import STANDARD_ATMOSPHERE, STANDARD_GRAVITY, parse_quantity


class VesselTable(Table):
    """``[rig.vessel]``: the fixed chamber of a valve test (m^3)."""

    volume: Volume | None = None


def _of_ports(name: Any) -> Any:
    """Return the arrangement of a valve of three ports, which serves one chamber; other names unchanged."""
    return "one-chamber" if name in ("3/2", "3/3") else name


class ValveTable(Table):
    """``[rig.valve]``: how the valves are connected, the command in V at which nothing flows, and their kind."""

    arrangement: Annotated[Literal["one-chamber", "5/3", "two"], BeforeValidator(_of_ports)] | None = None
    null: Voltage | Literal["identify"] = 0.0
    kind: Literal["proportional", "switching", "pressure"] = "proportional"


class SourceTable(Table):
    """``[rig.source]``: what fills the valve, or without a valve the chamber."""

    kind: Literal["regulator", "pump", "ejector"] = "regulator"


def _share_of_travel(travel: Any) -> float:
    """Return a travel that is stated in percent as a share of the stroke."""
    number, _, rest = str(travel).partition("%")
    try:
        share = float(number) / 100.0
    except ValueError:
        share = -1.0
    if rest.strip() or "%" not in str(travel) or not 0.0 <= share <= 1.0:
        raise ValueError(f'effective_area states the travel {travel!r}; wanted percent of the stroke, such as "40 %"')
    return share


Travel = Annotated[float, BeforeValidator(_share_of_travel, json_schema_input_type=str)]


class CylinderTable(Table):
    """``[rig.cylinder]`` in m^2, m, m^3 and kg; of a rotary axis m^3/rad, rad, m^3 and kg m^2."""

    piston_area_1: Area | None = None
    piston_area_2: Area | None = None
    effective_area: Annotated[list[tuple[Travel, Area]], Field(min_length=2)] | None = None
    stroke: Length | None = None
    dead_volume_1: Volume | None = None
    dead_volume_2: Volume | None = None
    moving_mass: Mass | None = None
    moment_of_inertia: Mass | None = None
    spring: Stiffness | None = None
    preload: Force | None = None
    bench_range: Annotated[list[GaugePressure], Field(min_length=2, max_length=2)] | None = None
    angle: Angle | None = None
    chamber_2: Literal["ambient"] | None = None

    @model_validator(mode="after")
    def _moves_one_way(self) -> CylinderTable:
        if self.moving_mass is not None and self.moment_of_inertia is not None:
            raise ValueError("an axis has a moving_mass or, if it turns, a moment_of_inertia; leave one of them out")
        return self

    @model_validator(mode="after")
    def _area_of_diaphragm(self) -> CylinderTable:
        if self.effective_area is None:
            return self
        if self.piston_area_1 is not None:
            raise ValueError("effective_area is that of piston_area_1, and both are stated; wanted one of them")
        shares, areas = np.array(sorted(self.effective_area)).T
        if shares[0] == shares[-1]:
            raise ValueError("effective_area states one travel alone; wanted areas from 0 % to 100 %")
        object.__setattr__(self, "piston_area_1", float(np.trapezoid(areas, shares) / (shares[-1] - shares[0])))
        return self


class RigTable(Table):
    """``[rig]``; pressures absolute in Pa, temperature in K.

    ``thermal``: how the gas in a chamber changes, or the exponent of it (1: isothermal).
    """

    gas_temperature: Temperature = 293.15
    ambient_pressure: Pressure = STANDARD_ATMOSPHERE
    supply_pressure: Pressure | None = None
    gas: GasName = "air"
    thermal: Annotated[float, Field(ge=1.0)] | Literal["adiabatic", "isothermal", "identify"] = "adiabatic"
    heat_capacity_ratio: HeatCapacityRatio | None = None
    gas_constant: GasConstant | None = None
    vessel: VesselTable = VesselTable()
    valve: ValveTable = ValveTable()
    cylinder: CylinderTable = CylinderTable()
    source: SourceTable = SourceTable()

    def stated(self) -> dict[str, Any]:
        """Return what is stated of gas, pressures and cylinder by name, SI; a gas by name has its constants."""
        plain = self.model_dump(exclude={"vessel", "cylinder", "valve", "source", "gas", "thermal"})
        of_effects = {"spring", "preload", "bench_range", "angle", "chamber_2", "effective_area"}  # or of others
        gas, cylinder = GASES[self.gas], self.cylinder.model_dump(exclude={"moment_of_inertia", *of_effects})
        if self.cylinder.moment_of_inertia is not None:
            cylinder["moving_mass"] = self.cylinder.moment_of_inertia
        plain["heat_capacity_ratio"] = self.heat_capacity_ratio or gas.heat_capacity_ratio
        plain["gas_constant"] = self.gas_constant or gas.gas_constant
        exponent = 1.0 if self.thermal == "isothermal" else self.thermal if isinstance(self.thermal, float) else None
        return {**plain, **cylinder, "polytropic_exponent": exponent, "exponent_free": self.thermal == "identify"}


PERCENT = "%"
PROCESS_VALVE_TESTS = ("positioner", "signature")  # experiments of the trade, each one of EXPERIMENT_KINDS


def in_words_of_the_bench(document: Any) -> Any:
    """Return the tables of a pipeline file in which chamber 2, travel and a valve's tests are stated as on a bench.

    ``[rig.cylinder] chamber_2 = "ambient"`` is ``chamber_2 = "open"`` of every recording that says nothing else, and
    ``unit = "%"`` of a position is a share of the stroke. A ``positioner`` is an axis whose chamber 2 is open, or,
    where its output is a pressure alone, a test of friction, as is the ``signature`` of a valve. What is at fault is
    left to the checks that follow.
    """
    cylinder = _table(_table(document, "rig"), "cylinder")
    changed: Any = dict(document) if isinstance(document, Mapping) else document
    if isinstance(changed, dict) and isinstance(changed.get("recordings"), list):
        changed["recordings"] = [_of_process_valve(one, _table(changed, "signals")) for one in changed["recordings"]]
    if cylinder.get("chamber_2") == "ambient" and isinstance(changed.get("recordings"), list):
        changed["recordings"] = [_opened(one) for one in changed["recordings"]]
    if (stroke := _stroke(cylinder)) is not None and isinstance(changed.get("signals"), Mapping):
        changed["signals"] = _in_metres(changed["signals"], stroke)
    return changed


def _table(document: Any, key: str) -> Mapping[str, Any]:
    found = document.get(key) if isinstance(document, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _of_process_valve(recording: Any, shared: Mapping[str, Any]) -> Any:
    test = recording.get("experiment") if isinstance(recording, Mapping) else None
    if test not in PROCESS_VALVE_TESTS:
        return recording
    commanded = test == "positioner" and any("u" in one for one in (shared, recording, _table(recording, "signals")))
    return {"chamber_2": "open", **recording, "experiment": "axis" if commanded else "friction"}


def _over_time(experiment: Any) -> Any:
    """Return the experiment as it stands; raises ValueError where its rows have no clock that friction needs."""
    if experiment == "friction-map":
        raise ValueError(
            "friction is not identified from rows of v and force without a clock; wanted readings over time of x or v "
            'and of force or p1, and experiment = "friction"'
        )
    return experiment


def _opened(recording: Any) -> Any:
    moves = isinstance(recording, Mapping) and recording.get("experiment") in ("axis", "closed-loop")
    return {"chamber_2": "open", **recording} if moves else recording


def _stroke(cylinder: Mapping[str, Any]) -> float | None:
    try:
        return parse_quantity(cylinder["stroke"], "m")
    except (KeyError, UnitError):
        return None


def _in_metres(signals: Mapping[str, Any], stroke: float) -> dict[str, Any]:
    def metres(name: str, one: Any) -> Any:
        if name not in ("x", "x_ref") or not isinstance(one, Mapping) or one.get("unit") != PERCENT:
            return one
        share = stroke / 100.0
        counted = {key: one.get(key, plain) for key, plain in (("scale", 1.0), ("offset", 0.0))}
        return {**one, "unit": "m"} | {k: v * share if isinstance(v, int | float) else v for k, v in counted.items()}

    return {name: metres(name, one) for name, one in signals.items()}


class PipelineTable(Table):
    """``[pipeline]``."""

    name: Name


class MoreTable(TextTable):
    """One ``[[recordings.more]]``: a further file of the recording, whose clock is moved by ``offset`` (s)."""

    file: Name
    offset: Instant | Literal["find"] | None = None
    match: SignalName | None = None
    signals: SignalsTable = SignalsTable()

    @model_validator(mode="after")
    def _found_by(self) -> MoreTable:
        if (self.offset == "find") != (self.match is not None):
            raise ValueError(
                'offset = "find" and match belong together; wanted match = "x", or any signal of both files'
            )
        return self


class RecordingTable(TextTable):
    """One ``[[recordings]]``: files, how to read them, what was measured, and what was held constant (SI)."""

    name: Name | None = None
    file: Name
    experiment: Annotated[
        Experiment,
        BeforeValidator(_over_time),
        WithJsonSchema({"enum": [*EXPERIMENT_KINDS, *PROCESS_VALVE_TESTS]}),
    ]
    use: Use
    test: Name | list[Name] | None = None
    take: list[SignalName] | None = None
    chamber_2: Literal["closed", "open", "valve"] | None = None
    chamber: Literal[1, 2] = 1
    imposed: Literal["motion"] | None = None
    valve: Literal["shut"] | None = None
    added_mass: Mass | None = None
    controller: Name | None = None
    signals: SignalsTable = SignalsTable()
    more: list[MoreTable] = Field(default_factory=list)
    from_: Annotated[Instant | None, Field(alias="from")] = None
    to: Instant | None = None
    u: Voltage | None = None
    u2: Voltage | None = None
    p_supply: Pressure | None = None
    p1: Pressure | None = None
    p2: Pressure | None = None
    x: Position | None = None
    v: Velocity | None = None
    a: Acceleration | None = None
    force: Force | None = None
    temperature: Temperature | None = None
    flow: MassFlow | None = None
    x_ref: Position | None = None
    p_ref: Pressure | None = None

    @property
    def held_constant(self) -> dict[str, float]:
        """What was held and not logged, SI."""
        return {name: getattr(self, name) for name in SIGNALS if getattr(self, name, None) is not None}

    @model_validator(mode="after")
    def _consistent(self) -> RecordingTable:
        if self.decimal is not None and self.decimal in (self.delimiter, self.thousands):
            raise ValueError(f'"{self.decimal}" cannot be the decimal mark and stand between columns or thousands too')
        if self.from_ is not None and self.to is not None and self.from_ >= self.to:
            raise ValueError(f"the stretch from {self.from_} s to {self.to} s is empty")
        kind = EXPERIMENT_KINDS[self.experiment]
        if kind.steady:
            self._require_no_clock()
        if self.imposed and kind.valve:
            raise ValueError(f'imposed = "motion" belongs to experiment = "friction", not to "{self.experiment}"')
        if kind.controlled and self.controller is None:
            raise ValueError('a closed-loop recording must say controller = "FILE", which export wrote, or "unknown"')
        if self.controller is not None and not kind.controlled:
            raise ValueError(f'controller belongs to experiment = "closed-loop", not to "{self.experiment}"')
        if self.added_mass is not None and not kind.cylinder:
            raise ValueError(f'added_mass moves with a piston, and experiment = "{self.experiment}" has none')
        if kind.axis and self.chamber_2 is None:
            raise ValueError('an axis recording must say chamber_2 = "closed", "open" or "valve"')
        return self

    def _require_no_clock(self) -> None:
        """Raise ValueError where a key belongs to a recording over time: rows of a steady bench have no clock."""
        stated = {
            "signals.time": self.signals.time,
            "take = time": "time" in (self.take or []),
            "from": self.from_,
            "to": self.to,
            "more": self.more,
            "chamber_2": self.chamber_2,
            "valve": self.valve,
        }
        for key, value in stated.items():
            if value not in (None, False, []):
                raise ValueError(
                    f'experiment = "flow" has rows without a clock: {key} does not belong to it; leave it out, or say '
                    'experiment = "valve" where these are readings over time'
                )


class PipelineConfig(Table):
    """The whole pipeline file; ``path`` is where it stands, ``document`` the tables as written."""

    pipeline: PipelineTable
    rig: RigTable = RigTable()
    signals: SignalsTable = SignalsTable()
    recordings: Annotated[list[RecordingTable], Field(min_length=1)]
    model: ModelTable = ModelTable()
    identify: IdentifyTable = IdentifyTable()
    compare: CompareTable = CompareTable()
    design: dict[str, Any] = Field(default_factory=dict)
    plan: PlanTable = PlanTable()
    scenarios: list[dict[str, Any]] = Field(default_factory=list)
    checks: dict[str, CheckTable] = Field(default_factory=dict)

    _rotary: bool = PrivateAttr(default=False)
    _tolerances: dict[str, float] = PrivateAttr(default_factory=dict)
    _path: Path = PrivateAttr(default=Path("pipeline.toml"))
    _document: dict[str, Any] = PrivateAttr(default_factory=dict)

    @property
    def path(self) -> Path:
        """The file that was read; relative paths in it start in its folder."""
        return self._path

    @property
    def rotary(self) -> bool:
        """Whether the axis turns: its x is an angle."""
        return self._rotary

    @property
    def tolerances(self) -> dict[str, float]:
        """Standard deviations (SI) of what ``[rig]`` states with a tolerance, by the names of parameters."""
        return self._tolerances

    def unit(self, signal: str) -> str:
        """The SI unit of a signal, as the axis moves."""
        unit = SIGNALS[signal].unit
        return ROTARY_UNITS.get(unit, unit) if self._rotary else unit

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """The calibrations of the signals that state one."""
        stated = {name: one.calibration for name, one in self.signals.present().items()}
        return {name: parse_calibration(own, self.unit(name)) for name, own in stated.items() if own is not None}

    @property
    def document(self) -> dict[str, Any]:
        """The TOML tables as written, before defaults and conversion."""
        return self._document

    @property
    def name(self) -> str:
        """The pipeline's name."""
        return self.pipeline.name

    def to_rig(self) -> Rig:
        """Return what is known of the rig, as domain packages receive it (SI)."""
        valve = self.rig.valve
        return Rig(
            **self.rig.stated(),
            vessel_volume=self.rig.vessel.volume,
            valve_null=0.0 if valve.null == "identify" else valve.null,
            null_free=valve.null == "identify",
            valve_arrangement=self.arrangement,
            valve_kind=valve.kind,
            source=self.rig.source.kind,
            axis_recorded=not self.recordings or any(EXPERIMENT_KINDS[t.experiment].axis for t in self.recordings),
        )

    @model_validator(mode="before")
    @classmethod
    def _in_words_of_the_bench(cls, document: Any) -> Any:
        return in_words_of_the_bench(document)

    @model_validator(mode="after")
    def _with_stated_effects(self, info: ValidationInfo) -> PipelineConfig:
        kinds = [EXPERIMENT_KINDS[one.experiment] for one in self.recordings]
        tolerances = (info.context or {}).get("tolerances", {})
        model = model_with_stated(self.model, self.rig, self.signals, kinds, tolerances)
        object.__setattr__(self, "model", model)
        return self

    @model_validator(mode="after")
    def _arranged(self) -> PipelineConfig:
        driven = [t for t in self.recordings if t.chamber_2 == "valve"]
        if driven and self.rig.valve.arrangement == "one-chamber":
            name = driven[0].name or driven[0].file
            raise ValueError(
                f'{name} says chamber_2 = "valve", but [rig.valve] has no path to chamber 2; wanted "5/3" or "two"'
            )
        return self

    @property
    def arrangement(self) -> ArrangementName:
        """How the valves are connected: as stated, else as the recordings need it."""
        stated = self.rig.valve.arrangement
        driven = any(table.chamber_2 == "valve" for table in self.recordings)
        return stated or ("two" if driven else "one-chamber")


class RigDescription(PipelineConfig):
    """A pipeline file of which only the rig is needed: it may have no recordings yet."""

    recordings: list[RecordingTable] = Field(default_factory=list)


def model_with_stated(
    model: ModelTable,
    rig: RigTable,
    signals: SignalsTable,
    kinds: Sequence[ExperimentKind],
    tolerances: Mapping[str, float],
) -> ModelTable:
    """Return ``[model]`` with the effects that the rig and the sensors state, at the values that they state.

    What ``[model.parameters]`` says of such a parameter counts in place of it; one with a standard deviation in
    ``tolerances`` is identified. Raises ValueError where what is stated needs something that is not.
    """
    known = dict(_stated(rig.cylinder, signals, kinds))
    regulates = rig.valve.kind == "pressure"
    if not known and not regulates:
        return model
    from pneucli.physics.effects import catalogue  # noqa: PLC0415 - it takes a moment, and few files need it

    parameters = [(p, f"{effect.name}.{p.name}") for effect in catalogue().values() for p in effect.parameters]
    places = {p.stated: name for p, name in parameters}
    of_candidates = {name for p, name in parameters if p.refines}  # they describe an effect that may be absent
    stated = {places[word]: value for word, value in known.items()}
    deviations = {places[word]: tolerances[word] for word in known if word in tolerances}
    loops = [name for name, e in catalogue().items() if regulates and e.part == "pressure valve"]
    names = [*loops, *dict.fromkeys(name.partition(".")[0] for name in stated if name not in of_candidates)]
    own = {
        name: ParameterTable(start=value, sigma=deviations[name]) if name in deviations else ParameterTable(fixed=value)
        for name, value in stated.items()
    }
    return model.model_copy(
        update={
            "effects": [*model.effects, *(name for name in names if name not in model.effects)],
            "parameters": own | model.parameters,
        }
    )


def _stated(
    cylinder: CylinderTable, signals: SignalsTable, kinds: Sequence[ExperimentKind]
) -> Iterator[tuple[str, float]]:
    """Yield what is stated, in the words of the parameters' ``stated``, with its values in SI."""
    if not kinds or any(kind.cylinder for kind in kinds):  # without recordings: a rig that a plan is made for
        yield from _spring(cylinder)
        if cylinder.angle is not None:
            if cylinder.moving_mass is None:
                raise ValueError("angle tells how the weight acts, and no moving_mass is stated; wanted it as well")
            gravity = STANDARD_GRAVITY * math.sin(cylinder.angle)
            yield "weight", cylinder.moving_mass * gravity
            yield "gravity along the axis", gravity
    lags = {one.lag for name, one in signals.present().items() if name in ("p1", "p2") and one.lag is not None}
    if len(lags) > 1:
        raise ValueError("p1 and p2 state different lags; wanted one for both")
    if not all(kind.steady for kind in kinds):
        yield from (("lag", lag) for lag in lags)


def _spring(cylinder: CylinderTable) -> Iterator[tuple[str, float]]:
    """Yield rate and relaxed position of a spring, stated as such or as the range of pressure over the stroke."""
    rate, preload = cylinder.spring, cylinder.preload
    if cylinder.bench_range is not None:
        if rate is not None or preload is not None:
            raise ValueError("bench_range is rate and preload of the spring; leave spring and preload out")
        if cylinder.piston_area_1 is None or cylinder.stroke is None:
            raise ValueError("bench_range needs piston_area_1 and stroke; wanted both as well")
        low, high = cylinder.bench_range
        rate, preload = (high - low) * cylinder.piston_area_1 / cylinder.stroke, low * cylinder.piston_area_1
    if rate is not None:
        yield "spring", rate
        yield "relaxed position of the spring", -(preload or 0.0) / rate
    elif preload is not None:
        raise ValueError("preload belongs to a spring; wanted the rate of the spring as well")
