"""The exported FMU is the simulated plant, and behaves as FMI 3.0 asks."""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest

from pneucli.errors import InputError
from pneucli.export.fmu.package import FILE_NAME, write_fmu
from pneucli.export.fmu.plant import REFUSED_PORTS, Plant, plant_of, require_valve, variables_of
from pneucli.physics.effects import catalogue, load_plugin
from pneucli.simulate import layout as at
from pneucli.simulate.build import build
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model
from tests.simulate.synthetic_experiments import (
    RIG,
    VALVE,
    held_commands,
    make_experiment,
    model,
    time_grid,
    typical_values,
)
from tests.simulate.test_build import run_in

fmpy = pytest.importorskip("fmpy", reason="needs FMPy")
validation = pytest.importorskip("fmpy.validation")

TIME = time_grid(0.4)
U = held_commands(TIME, (0.0, 4.0, -4.0, 0.0, -1.0), 0.08)
EXPORTABLE = [name for name, e in catalogue().items() if not REFUSED_PORTS.keys() & e.ports.keys()]
GROUPS = [EXPORTABLE[i::6] for i in range(6)]  # every effect once; an FMU for each would take minutes
CHANNELS = {"x": at.X, "v": at.V, "a": at.A, "p1": at.R1, "p2": at.R2, "temperature": at.GAS_T}
WHERE = "bench.toml, key model.effects"


@dataclass(frozen=True)
class Case:
    """A model, the experiment that the simulation runs, and the FMU of the model."""

    model: Model
    experiment: Experiment
    plant: Plant
    path: Path

    @cached_property
    def simulated(self) -> np.ndarray:
        """What the kernel computes, as plain Python: that needs no compilation."""
        return run_in(build(self.model.effects, compiled=False), self.model, self.experiment)

    def in_fmpy(self, fmi_type: str = "CoSimulation", **start: float) -> np.ndarray:
        """What FMPy reads from the FMU, which starts as the simulation does."""
        first = dict(zip(("x", "v", "p1", "p2"), self.simulated[0, [at.X, at.V, at.P1, at.P2]], strict=True))
        offered = {v.name for v in variables_of(self.plant)}
        values = {f"start.{name}": value for name, value in first.items()} | start
        columns = [(name, self.experiment.inputs[:, at.INPUTS.index(name)]) for name in self.plant.inputs]
        signals = np.rec.fromarrays([TIME, *(c for _, c in columns)], names=["time", *(n for n, _ in columns)])
        return fmpy.simulate_fmu(
            str(self.path),
            fmi_type=fmi_type,
            record_events=False,
            stop_time=TIME[-1],
            step_size=1e-3,
            output_interval=1e-3,
            input=signals,
            start_values={name: value for name, value in values.items() if name in offered},
        )


def case(folder: Path, names: Sequence[str], kind: str = "axis", chamber_2: str = "valve", rig=RIG) -> Case:
    what = model(names, typical_values([catalogue()[n] for n in names]) | {"rig.vessel_volume": 1e-3}, rig)
    signals = {
        "u": U,
        **({"u2": -0.7 * U} if chamber_2 == "valve" else {}),
        **({} if kind == "valve" else {"force": 20.0}),
    }
    experiment = make_experiment(kind, TIME, signals, chamber_2, rig=rig)
    if rig.arrangement.chamber_2 == "mirrored":
        experiment.flags[at.CHAMBER_2] = at.MIRRORED
    experiment.flags[at.STATED_SUPPLY] = 1.0
    plant = replace(plant_of("bench", what, [experiment], {}, WHERE), flags=experiment.flags)
    write_fmu(folder, plant, WHERE)
    return Case(what, experiment, plant, folder / FILE_NAME)


def largest_difference(one: Case) -> float:
    """Of all outputs, relative to the range of each."""
    simulated, result = one.simulated, one.in_fmpy()
    # a valve that sets a pressure asks for less than what holds the piston
    assert np.ptp(simulated[:, at.X]) > 1e-3 or one.experiment.vessel or np.ptp(simulated[:, at.P1]) > 1e4
    shown = {name: column for name, column in CHANNELS.items() if name in result.dtype.names}
    return max(
        float(np.abs(result[name] - simulated[:, column]).max()) / max(float(np.ptp(simulated[:, column])), 1e-9)
        for name, column in shown.items()
    )


@pytest.mark.parametrize("names", GROUPS, ids="+".join)
def test_every_effect_of_the_catalogue_moves_the_fmu_as_it_moves_the_simulation(
    names: list[str], tmp_path: Path
) -> None:
    assert largest_difference(case(tmp_path, names)) <= 1e-9


@pytest.mark.parametrize(
    ("kind", "chamber_2", "arrangement"),
    [
        ("axis", "valve", "5/3"),
        ("axis", "closed", "one-chamber"),
        ("axis", "open", "one-chamber"),
        ("valve", "open", "one-chamber"),
    ],
)
def test_every_arrangement_is_the_simulated_one(kind: str, chamber_2: str, arrangement: str, tmp_path: Path) -> None:
    rig = replace(RIG, valve_arrangement=arrangement)
    if kind == "valve":
        rig = replace(rig, piston_area_1=None, piston_area_2=None, moving_mass=None)  # the vessel of a valve test
    assert largest_difference(case(tmp_path, ["stribeck"] if kind == "axis" else [], kind, chamber_2, rig)) <= 1e-9


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return case(tmp_path_factory.mktemp("fmu"), ["stribeck", "heat-transfer", "valve-lag", "line-delay"])


def test_fmpy_finds_no_fault_in_the_description(axis: Case) -> None:
    assert validation.validate_fmu(str(axis.path)) == []
    described = fmpy.read_model_description(str(axis.path), validate_variable_names=True, validate_model_structure=True)
    assert described.fmiVersion == "3.0"
    assert {v.name: v.unit for v in described.modelVariables}["friction.viscous"] == "N s/m"


def test_the_same_plant_is_the_same_file_to_the_last_byte(axis: Case, tmp_path: Path) -> None:
    """Other artifacts are so too: a killed run that continues gives what an undisturbed one gives."""
    write_fmu(tmp_path, axis.plant, WHERE)
    assert (tmp_path / FILE_NAME).read_bytes() == axis.path.read_bytes()


def test_a_parameter_carries_its_interval(axis: Case) -> None:
    plant = replace(axis.plant, intervals={"friction.coulomb": (13.9, 14.2)})
    coulomb = next(v for v in variables_of(plant) if v.name == "friction.coulomb")
    assert (coulomb.start, coulomb.unit) == (14.0, "N")
    assert coulomb.description == "Coulomb friction; identified, 95 % interval 13.9 to 14.2"


def test_a_parameter_set_before_the_start_acts_as_in_the_simulation(axis: Case) -> None:
    heavier = replace(axis, model=replace(axis.model, values={**axis.model.values, "rig.moving_mass": 9.0}))
    assert np.array_equal(heavier.in_fmpy(**{"rig.moving_mass": 9.0})["x"], heavier.simulated[:, at.X])
    assert not np.array_equal(axis.in_fmpy()["x"], heavier.simulated[:, at.X])


def test_half_of_the_valves_area_is_half_of_the_flow(axis: Case) -> None:
    half = replace(axis, model=replace(axis.model, valve=VALVE.scaled(0.5)))
    halved = half.in_fmpy(**{"valve.area_factor_1": 0.5, "valve.area_factor_2": 0.5})
    assert halved["p1"] == pytest.approx(half.simulated[:, at.R1], rel=1e-9)


class Slave:
    """An instance of the FMU, called as an importer calls it."""

    kind = fmpy.fmi3.FMU3Slave

    def __init__(self, one: Case, folder: str) -> None:
        description = fmpy.read_model_description(folder)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        token, identifier = description.instantiationToken, description.coSimulation.modelIdentifier
        self.fmu = self.kind(guid=token, unzipDirectory=folder, modelIdentifier=identifier)
        self.messages: list[str] = []
        self.fmu.instantiate(logMessage=fmpy.fmi3.fmi3LogMessageCallback(self._log))

    def _log(self, environment: object, status: int, category: bytes, message: bytes) -> None:
        self.messages.append(message.decode())

    def begin(self) -> None:
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        self.fmu.setFloat64([self.references[name]], [value])

    def get(self, name: str) -> float:
        return float(self.fmu.getFloat64([self.references[name]])[0])

    def step(self, begin: float, number: int = 50, step: float = 1e-3) -> float:
        for i in range(number):
            self.fmu.doStep(currentCommunicationPoint=begin + i * step, communicationStepSize=step)
        return begin + number * step


@pytest.fixture
def slave(axis: Case, tmp_path: Path) -> Iterator[Slave]:
    one = Slave(axis, fmpy.extract(str(axis.path), unzipdir=str(tmp_path)))
    yield one
    one.fmu.terminate()
    one.fmu.freeInstance()


def test_a_saved_state_continues_as_the_first_time(slave: Slave) -> None:
    slave.begin()
    slave.set("u", 3.0)
    time = slave.step(0.0)
    state = slave.fmu.getFMUState()
    kept = slave.fmu.serializeFMUState(state)
    slave.step(time)
    first = [slave.get(name) for name in ("x", "v", "p1", "p2")]
    slave.fmu.setFMUState(slave.fmu.deserializeFMUState(kept))
    slave.step(time)
    assert [slave.get(name) for name in ("x", "v", "p1", "p2")] == first
    slave.fmu.freeFMUState(state)


def test_a_parameter_cannot_change_during_the_run(slave: Slave) -> None:
    slave.begin()
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.set("rig.moving_mass", 3.0)
    assert slave.messages == ["a parameter can be set before the end of the initialization only"]


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        ({"rig.gas_temperature": sys.float_info.min, "start.p1": 1e300}, "the start values give no finite state"),
        ({"start.x": 10.0}, "start.x is beyond an end of the stroke"),
    ],
)
def test_an_impossible_start_ends_with_a_reason(slave: Slave, stated: dict[str, float], says: str) -> None:
    for name, value in stated.items():
        slave.set(name, value)
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.begin()
    assert slave.messages == [says]


@pytest.mark.parametrize(
    ("name", "value"),
    [("rig.moving_mass", 0.0), ("rig.stroke", -1.0), ("start.p1", 0.0), ("valve.critical_ratio", 1.1),
     ("valve-lag.time_constant", -1e-3)],
)  # fmt: skip
def test_a_parameter_beyond_its_range_is_refused(slave: Slave, name: str, value: float) -> None:
    with pytest.raises(fmpy.fmi1.FMICallException):
        slave.set(name, value)
    assert slave.messages[0].startswith(f"{name} = {value:.9g} is too ")


def test_every_parameter_begins_within_the_range_that_the_description_states(axis: Case) -> None:
    described = {v.name: v for v in fmpy.read_model_description(str(axis.path)).modelVariables}
    assert (described["rig.stroke"].min, described["valve.critical_ratio"].max) == (repr(sys.float_info.min), "1.0")
    for v in variables_of(axis.plant):
        assert v.kind != "parameter" or v.lowest <= (v.start or 0.0) <= v.highest, v.name


@pytest.fixture(scope="module")
def older(axis: Case, tmp_path_factory: pytest.TempPathFactory) -> Case:
    """The same plant as an FMU of FMI 2.0."""
    folder = tmp_path_factory.mktemp("fmi2")
    write_fmu(folder, axis.plant, WHERE, "2.0")
    return replace(axis, path=folder / FILE_NAME)


def test_in_fmi_2_the_plant_is_the_same(older: Case) -> None:
    assert validation.validate_fmu(str(older.path)) == []
    assert fmpy.read_model_description(str(older.path)).fmiVersion == "2.0"
    assert largest_difference(older) <= 1e-9
    exchanged, stepped = older.in_fmpy(fmi_type="ModelExchange"), older.in_fmpy()
    assert float(np.abs(exchanged["p1"] - stepped["p1"]).max()) <= 1e-9 * float(np.ptp(stepped["p1"]))


def test_in_fmi_2_a_state_is_restored_and_a_mass_of_nothing_is_refused(older: Case, tmp_path: Path) -> None:
    folder = fmpy.extract(str(older.path), unzipdir=str(tmp_path))
    described = fmpy.read_model_description(folder)
    at_name = {v.name: [v.valueReference] for v in described.modelVariables}
    fmu = fmpy.fmi2.FMU2Slave(guid=described.guid, unzipDirectory=folder, modelIdentifier="pneucli_plant")
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmu.setReal(at_name["rig.moving_mass"], [0.0])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    kept = fmu.serializeFMUstate(fmu.getFMUstate())
    fmu.setReal(at_name["u"], [3.0])
    pressures = []
    for _ in range(2):
        for i in range(50):
            fmu.doStep(currentCommunicationPoint=1e-3 * i, communicationStepSize=1e-3)
        pressures.append(fmu.getReal(at_name["p1"])[0])
        fmu.setFMUstate(fmu.deSerializeFMUstate(kept))
        fmu.setReal(at_name["u"], [3.0])
    assert pressures[0] == pressures[1]
    fmu.terminate()
    fmu.freeInstance()


def test_after_a_reset_the_run_repeats(slave: Slave) -> None:
    for _ in range(2):
        slave.begin()
        slave.set("u", 3.0)
        slave.step(0.0)
        end = slave.get("p1")
        slave.fmu.reset()
    slave.begin()
    slave.set("u", 3.0)
    slave.step(0.0)
    assert slave.get("p1") == end


def test_a_long_communication_step_is_divided(slave: Slave) -> None:
    """The commands are held, so one step of 50 ms is 50 steps of 1 ms but for the phase of the inner steps."""
    slave.begin()
    slave.set("u", 3.0)
    slave.step(0.0, 1, 0.05)
    long = slave.get("p1")
    slave.fmu.reset()
    slave.begin()
    slave.set("u", 3.0)
    slave.step(0.0, 50, 1e-3)
    assert long == pytest.approx(slave.get("p1"), rel=1e-3)


@pytest.mark.parametrize("name", ["time-skew", "force-skew"])
def test_an_effect_of_the_recorder_is_refused(name: str) -> None:
    experiment = make_experiment("axis", TIME, {"u": U})
    with pytest.raises(InputError, match=name) as raised:
        plant_of("bench", model([name], {f"{name}.delay": 1e-3}), [experiment], {}, WHERE)
    assert "pneucli remove" in raised.value.mend


def test_a_rig_without_a_valve_is_refused() -> None:
    friction = make_experiment("friction", TIME, {"p1": 3e5})
    shut = make_experiment("valve", TIME, {"u": U}, valve_shut=True)
    with pytest.raises(InputError, match="key recordings: no recording shows a valve"):
        require_valve([friction, shut], "rig.toml, key recordings")
    require_valve([friction, make_experiment("valve", TIME, {"u": U})], "rig.toml, key recordings")


PLUGIN = '''
import math

from pneucli.physics.declaration import Effect, Parameter


def force(x, v, stroke, gain):
    """Force in N."""
    return {force}


EFFECT = Effect(
    name="own", title="Own", part="cylinder", parameters=(Parameter("gain", "N", 0.0, 0.0, 1e3, (10.0,)),),
    ports={{"force": force}}, equation="", looks_like="", shows_over="v", twins=(), separate="", source="",
)
'''


def own_effect(folder: Path, force: str) -> Case:
    """An axis with a user's effect, whose force is a text of Python."""
    (folder / "own.py").write_text(PLUGIN.format(force=force))
    experiment = make_experiment("axis", TIME, {"u": U, "u2": -U, "force": 0.0}, "valve")
    experiment.flags[at.STATED_SUPPLY] = 1.0
    what = replace(model((), {"own.gain": 30.0}), effects=(load_plugin(folder / "own.py"),))
    plant = replace(plant_of("bench", what, [experiment], {}, WHERE), flags=experiment.flags)
    write_fmu(folder, plant, WHERE)
    return Case(what, experiment, plant, folder / FILE_NAME)


def test_a_users_own_effect_is_exported(tmp_path: Path) -> None:
    """Powers, a quotient of integers, a chain of comparisons: Python means other things by them than C."""
    force = "-gain * (1 / 4) * v ** 3 * (2 if 0 <= x < stroke / 2 else 1) - gain * math.tanh(v / 0.1)"
    assert largest_difference(own_effect(tmp_path, force)) <= 1e-9


def test_python_without_a_counterpart_in_c_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="own__force"):
        own_effect(tmp_path, "-gain * round(v) // 3")


@pytest.mark.parametrize("names", [["stribeck"], ["friction-hysteresis", "line-delay", "valve-lag", "presliding"]])
def test_model_exchange_is_the_same_plant(names: list[str], tmp_path: Path) -> None:
    one = case(tmp_path, names)
    result = one.in_fmpy(fmi_type="ModelExchange")
    for name in ("x", "v", "p1", "p2"):
        simulated = one.simulated[:, CHANNELS[name]]
        assert float(np.abs(result[name] - simulated).max()) <= 1e-9 * float(np.ptp(simulated)), name


class Exchange(Slave):
    """An instance for model exchange, called as an importer's solver calls it."""

    kind = fmpy.fmi3.FMU3Model

    def event(self, time: float) -> float:
        """The next event that the FMU asks for, after one at this time."""
        self.fmu.setTime(time)
        self.fmu.enterEventMode()
        *_, defined, following = self.fmu.updateDiscreteStates()
        self.fmu.enterContinuousTimeMode()
        assert defined
        return float(following)


@pytest.fixture
def exchange(axis: Case, tmp_path: Path) -> Iterator[Exchange]:
    one = Exchange(axis, fmpy.extract(str(axis.path), unzipdir=str(tmp_path)))
    one.begin()
    yield one
    one.fmu.terminate()
    one.fmu.freeInstance()


def test_between_events_of_model_exchange_nothing_moves(exchange: Exchange) -> None:
    following = exchange.event(0.0)
    assert following == pytest.approx(1e-3)
    first = exchange.get("p1")
    exchange.set("u", 4.0)
    exchange.fmu.setTime(0.5e-3)
    assert (exchange.get("p1"), exchange.get("time")) == (first, 0.5e-3)


def test_an_input_acts_from_the_event_at_which_it_was_set(exchange: Exchange) -> None:
    exchange.event(0.0)
    rest = exchange.get("chamber_1.p")
    exchange.set("u", 4.0)
    exchange.event(1e-3)  # what passed was still held at 0 V
    assert exchange.get("chamber_1.p") == rest
    for k in range(2, 40):  # the hose delays the flow
        exchange.event(1e-3 * k)
    assert exchange.get("chamber_1.p") > rest


def test_an_event_that_comes_early_moves_the_plant_by_that_time(exchange: Exchange) -> None:
    exchange.event(0.0)
    assert exchange.event(0.4e-3) == pytest.approx(1.4e-3)
