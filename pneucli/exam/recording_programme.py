"""Plan the recordings of a rig, by its kind and its conditions."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.exam.conditions import Conditions
from pneucli.exam.laboratory import Laboratory, RecordingPlan
from pneucli.exam.rig.excitations import (
    MotionMachine,
    SteadyRows,
    back_and_forth_reference,
    closed_loop,
    single_acting,
    stick_slip,
    two_sine_reference,
    valve_pulses,
    valve_staircase,
    valve_step,
)
from pneucli.exam.rig.parameters import ONE_CHAMBER, TWO_VALVES, Parameters
from pneucli.exam.rig.simulation import LOOP_PERIOD, Excitation
from pneucli.exam.rig_scaling import RigScaling

STEP_COMMANDS = ((0.6, 1.2, 2.5, 4.0, 6.0, 8.0, 10.0), (0.5, 1.0, 2.0, 3.5, 5.0, 7.5, 10.0))
SPEEDS = 6  # of a machine that drives at constant speeds, from 2 to 200 mm/s on a stroke of 200 mm
MAX_STROKE_TIME = 5.0  # s
STAIRCASE_COMMANDS = ((0.5, 1.6), (0.7, 1.2))


class RecordingProgramme:
    """The recordings of one rig; ``stated_rig`` is the rig without hidden effects, whose loads balance at the start."""

    def __init__(
        self,
        laboratory: Laboratory,
        stated_rig: Parameters,
        similar: RigScaling,
        conditions: Conditions,
        rng: np.random.Generator,
    ) -> None:
        self.laboratory, self.stated_rig, self.scaling = laboratory, stated_rig, similar
        self.conditions, self.rng = conditions, rng

    def plans(self, kind: str) -> list[RecordingPlan]:
        """Return all recordings of a rig of that kind; the last of each experiment, or a step, is for testing."""
        takes: list[RecordingPlan] = []
        if self.conditions.source is not None and not self.conditions.source_stated:
            takes += [RecordingPlan("steady_rows", "flow", "train", self._steady_rows())]
        if self.laboratory.vessel_volume is not None:
            takes += self._valve_tests(1, tested=kind == "valve")
            if self.stated_rig.arrangement != ONE_CHAMBER:
                takes += self._valve_tests(2, tested=False)
        if self.conditions.constant_speed:
            return self._constant_speeds()
        if self.conditions.imposed:
            return _numbered("strokes", "friction", self._strokes())
        if kind == "friction":
            takes += self._stick_slip()
            takes += _numbered("driven", "friction", [self._driven(6000) for _ in range(3)])
        if kind == "axis":
            takes += _numbered("axis", "axis", [self._driven(8000) for _ in range(4)])
        if kind == "axis" and not self.conditions.bench_test:
            takes += _numbered("moves", "axis", [self._move(8000) for _ in range(3)])
        return takes

    def _valve_tests(self, chamber: Literal[1, 2], tested: bool) -> list[RecordingPlan]:
        bench = self.laboratory.valve_test_rig(chamber)
        before = "" if chamber == 1 else "chamber_2_"
        if self.conditions.switching:
            moves = [valve_step(bench, bench.command_range), *(valve_pulses(bench, self.rng) for _ in range(3))]
            return _numbered(f"{before}pulses", "valve", moves, chamber)
        levels = STEP_COMMANDS[int(self.rng.integers(len(STEP_COMMANDS)))]
        steps = [
            RecordingPlan(
                f"{before}step_+{v * self.scaling.command}V",
                "valve",
                "test" if tested and v == levels[3] else "train",
                valve_step(bench, v * self.scaling.command),
                chamber,
            )
            for v in levels
        ]
        stairs = [valve_staircase(bench, *(self.scaling.command * v for v in pair)) for pair in STAIRCASE_COMMANDS]
        planned = steps + _numbered(f"{before}stairs", "valve", stairs, chamber)
        return planned if bench.regulated_span <= 0.0 else [_at_half_span(bench, take) for take in planned]

    def _steady_rows(self) -> SteadyRows:
        """Return rows at commands from a fifth of the range on, each with throttles up to a third of the valve."""
        shares = np.array([0.2, 0.4, 0.6, 0.8, 0.95])
        full, regulated = self.stated_rig.command_range, self.conditions.source == "regulated"
        throttles = self.stated_rig.effective_area * np.geomspace(0.02, 0.35, 7) * self.rng.uniform(0.8, 1.2)
        return SteadyRows(full * (2.0 * shares - 1.0) if regulated else full * shares, throttles)

    def _stick_slip(self) -> list[RecordingPlan]:
        par, position = self.laboratory.parameters, 0.15 * self.stated_rig.stroke
        rates = (self.rng.uniform(5e3, 8e3), self.rng.uniform(9e3, 14e3))
        moves = [
            stick_slip(par, rate * self.scaling.pressure, position, load=self._stated_load(position)) for rate in rates
        ]
        return _numbered("stickslip", "friction", moves)

    def _strokes(self) -> list[MotionMachine]:
        """Return strokes at four pressures, the last between the others; they cross the place of a friction patch."""
        par = self.laboratory.parameters
        stroke, gauge = self.stated_rig.stroke, self.stated_rig.supply - self.stated_rig.ambient
        start = float(self.rng.uniform(0.1, 0.4)) * stroke
        way, speed = float(self.rng.uniform(0.15, 0.25)) * stroke, float(self.rng.uniform(0.03, 0.06)) * stroke
        if par.position_gain > 0.0:
            start = par.position_from - float(self.rng.uniform(0.1, 0.4)) * way
        levels = np.array([0.15, 0.45, 1.0, 0.7]) * self.rng.uniform(0.85, 1.0)
        swing = float(self.rng.uniform(0.002, 0.01))
        return [
            MotionMachine(
                (start, start + way), (speed, 2.5 * speed), 10, self.stated_rig.ambient + level * gauge, swing
            )
            for level in levels
        ]

    def _constant_speeds(self) -> list[RecordingPlan]:
        """Return a recording for each speed, direction and one of two pressures; one speed is for testing."""
        par, gauge = self.laboratory.parameters, self.stated_rig.supply - self.stated_rig.ambient
        middle = 0.5 * self.stated_rig.stroke
        if par.position_gain > 0.0:
            middle = par.position_from
        speeds = np.geomspace(0.01, 1.0, SPEEDS) * self.stated_rig.stroke * self.rng.uniform(0.8, 1.2)
        plans = []
        for level in (0.1, 0.6):
            pressure = self.stated_rig.ambient + level * float(self.rng.uniform(0.8, 1.2)) * gauge
            for k, speed in enumerate(speeds.tolist()):
                half = 0.5 * min(speed * MAX_STROKE_TIME, 0.4 * self.stated_rig.stroke)
                ways = (("out", 1.0), ("back", -1.0))
                plans += [
                    RecordingPlan(
                        f"speed_{k + 1}_{way}_{'low' if level < 0.5 else 'high'}",
                        "friction",
                        "test" if k == SPEEDS // 2 else "train",
                        MotionMachine((middle - side * half, middle + side * half), (speed,), 1, pressure, steady=True),
                    )
                    for way, side in ways
                ]
        return plans

    def _move(self, samples: int) -> Excitation:
        """Return moves from point to point, far from the ends of the stroke."""
        stroke, share = self.stated_rig.stroke, self.rng.uniform(0.2, 0.4)
        low, high = float(self.rng.uniform(0.2, 0.35)) * stroke, float(self.rng.uniform(0.6, 0.75)) * stroke
        return self._following(back_and_forth_reference(self.rng, samples, share, (low, high)))

    def _driven(self, samples: int) -> Excitation:
        return self._following(self._reference(samples))

    def _following(self, reference: Array) -> Excitation:
        par, rng, samples = self.laboratory.parameters, self.rng, reference.size
        gain = rng.uniform(100.0, 200.0) * self.scaling.command / self.scaling.length
        gauge = rng.uniform(1.3e5, 2.2e5) * self.scaling.pressure * (1.4 if self.conditions.ends else 1.0)
        if self.conditions.differential:
            gauge *= par.piston_area_2 / par.piston_area_1  # the smaller side has the higher pressure
        load = self._stated_load(float(reference[0]))
        if par.regulated_span > 0.0:  # at the null it gives half of its span
            return closed_loop(par, reference, 2.0 * gain, 0.5 * par.regulated_span, load)
        if par.arrangement == ONE_CHAMBER:
            if self.conditions.load == "spring":
                return single_acting(par, reference, gain, load)
            return closed_loop(par, reference, gain, gauge, load)
        second = self._mean_pressure_swing(samples) if par.arrangement == TWO_VALVES else None
        return closed_loop(par, reference, 0.5 * gain, 1.8 * gauge, load, second)

    def _reference(self, samples: int) -> Array:
        if not self.conditions.ends:
            return two_sine_reference(self.rng, samples, self.stated_rig.stroke)
        stroke, share = self.stated_rig.stroke, self.rng.uniform(0.5, 0.75)
        # the enclosed air keeps the piston from the other end
        is_shut_in = self.stated_rig.arrangement == ONE_CHAMBER and self.conditions.load != "spring"
        beyond = self.rng.uniform(0.05, 0.2, 2)
        return back_and_forth_reference(
            self.rng, samples, share, (-beyond[0] * stroke, (0.5 if is_shut_in else 1.0 + beyond[1]) * stroke)
        )

    def _mean_pressure_swing(self, samples: int) -> Array:
        """Return what the second valve adds to the negated first command (V): a slow swing of the mean pressure."""
        swing = self.rng.uniform(0.03, 0.08) * self.stated_rig.command_range
        phase = 2 * np.pi * (LOOP_PERIOD * np.arange(samples) / self.rng.uniform(1.0, 3.0) + self.rng.random())
        return np.asarray(swing * np.sin(phase))

    def _stated_load(self, position: float) -> float:
        """Return the stated force in N toward x = 0."""
        rig = self.stated_rig
        return rig.constant_force + rig.spring_stiffness * (position - rig.spring_rest)


def _at_half_span(bench: Parameters, take: RecordingPlan) -> RecordingPlan:
    """Return a test of a valve with a pressure loop that begins at the pressure of its null."""
    assert isinstance(take.excitation, Excitation)
    pressure = bench.ambient + 0.5 * bench.regulated_span
    return replace(take, excitation=replace(take.excitation, pressure_1=pressure))


def _numbered(
    name: str,
    experiment: Literal["valve", "friction", "axis"],
    moves: Sequence[Excitation | MotionMachine],
    chamber: Literal[1, 2] = 1,
) -> list[RecordingPlan]:
    last = len(moves)
    return [
        RecordingPlan(f"{name}_{i}", experiment, "test" if i == last else "train", move, chamber)
        for i, move in enumerate(moves, 1)
    ]
