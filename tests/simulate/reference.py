"""The reference solution: the base equations, implemented a second time and integrated by scipy to tight tolerances.

It shares nothing with the kernel but the values of the model and the areas of its valve. Friction is a hybrid system:
the piston slides up, slides down or sticks, and each mode ends at an event that scipy locates. It is some hundred
times slower than the kernel; tests compare both.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np

from pneucli.arrays import Array
from pneucli.simulate.model import Model

Force = Callable[[float], float]

X, V, P1, P2, T1, T2 = range(6)
RTOL, ATOL = 1e-9, np.array([1e-11, 1e-10, 1e-4, 1e-4, 1e-7, 1e-7])
BREAKAWAY_SPEED = 1e-9  # m/s of a piston that breaks away, to leave the event
SUPPORTED_EFFECTS = {"stribeck", "friction-hysteresis", "heat-transfer"}


def solve(
    model: Model,
    time: Array,
    u: Array,
    start: Array,
    chamber_2: Literal["closed", "open", "valve"] = "closed",
    u2: Array | None = None,
    force: Force = lambda _: 0.0,
) -> Array:
    """Solve the equations of the axis.

    Args:
        model: A model with no effects but stribeck, friction-hysteresis and heat-transfer.
        time: Time stamps in s, shape (n,).
        u: Command of chamber 1 in V, held from sample to sample, shape (n,).
        start: State at the first sample, shape (6,).
        chamber_2: What closes chamber 2.
        u2: Command of chamber 2 in V, shape (n,).
        force: External force in N toward +x over time in s.

    Returns:
        x in m, v in m/s, p1 and p2 in Pa, T1 and T2 in K, shape (n, 6).

    Raises:
        ValueError: The model has other effects.

    References:
        Thesis 2.42-2.46 (flow), 2.47-2.52 (state space), 3.4, 3.6 and 6.21 (friction). Between the branches of friction
        dv/dt = 0 (Filippov).
    """
    if unknown := {e.name for e in model.effects} - SUPPORTED_EFFECTS:
        raise ValueError(f"the reference has no equations for {sorted(unknown)}")
    plant = Plant(
        model.base_values() | dict(model.values), "heat-transfer.conductance" in model.values, chamber_2, force
    )
    commands = np.column_stack([u, np.zeros(time.size) if u2 is None else u2])
    changes = 1 + np.flatnonzero(np.any(np.diff(commands[:-1], axis=0) != 0, axis=1))
    out = np.empty((time.size, 6))
    out[0] = start
    for first, last in pairwise([0, *changes.tolist(), time.size - 1]):
        area_1, area_2 = model.valve(commands[first])
        signed = (math.copysign(area_1, u[first]), math.copysign(area_2, commands[first, 1]))
        out[first + 1 : last + 1] = plant.integrate(time[first : last + 1], out[first], signed)
    return out


@dataclass(frozen=True)
class Plant:
    """The equations with parameters by name; effective ``areas`` (m^2) in arguments are negative for exhaust."""

    values: dict[str, float]
    has_heat_transfer: bool
    chamber_2: str
    force: Force

    def integrate(self, time: Array, y: Array, areas: tuple[float, float]) -> Array:
        """Return the states at ``time[1:]`` for held commands; scipy is called once for each mode."""
        from scipy.integrate import solve_ivp

        rows, t = [], float(time[0])
        mode = self.motion_direction(t, y)
        while True:
            found = solve_ivp(
                partial(self.state_derivatives, mode=mode, areas=areas),
                (t, time[-1]),
                y + BREAKAWAY_SPEED * mode * (np.arange(6) == V) * (y[V] == 0.0),
                method="LSODA",
                t_eval=time[time > t],
                events=self.events(mode),
                rtol=RTOL,
                atol=ATOL,
            )
            rows.append(found.y.T)
            if found.status == 0:
                return np.vstack(rows)
            t, y, mode = self.state_after_event(found, mode)

    def state_after_event(self, found: object, mode: float) -> tuple[float, Array, float]:
        """Return time, state and mode after the event that ended a mode."""
        times, states = found.t_events, found.y_events  # type: ignore[attr-defined]
        which = next(i for i, t in enumerate(times) if t.size)
        t, y = float(times[which][0]), states[which][0].copy()
        if mode == 0.0:
            return t, y, math.copysign(1.0, self.driving_force(t, y))
        y[V] = 0.0
        if which == 1:
            y[X] = self.values["rig.stroke"] if mode > 0 else 0.0
        return t, y, self.motion_direction(t, y)

    def events(self, mode: float) -> list[Callable[[float, Array], float]]:
        """Return scipy's events: sticking ends at break-away, sliding at a stop or at an end of the stroke."""
        if mode == 0.0:
            return [_falling(lambda t, y: -self.breakaway_excess(t, y))]
        stroke = self.values["rig.stroke"]
        room = (lambda _, y: stroke - y[X]) if mode > 0 else (lambda _, y: y[X])
        return [_falling(lambda _, y: mode * y[V]), _falling(room)]

    def motion_direction(self, t: float, y: Array) -> float:
        """Return the direction of motion, or of the motion that begins; 0 while sticking."""
        if y[V] != 0.0:
            return math.copysign(1.0, y[V])
        return math.copysign(1.0, self.driving_force(t, y)) if self.breakaway_excess(t, y) > 0.0 else 0.0

    def breakaway_excess(self, t: float, y: Array) -> float:
        """Force in N beyond the friction that holds at rest; an end holds any force against it."""
        push = self.driving_force(t, y)
        if (push < 0.0 and y[X] <= 0.0) or (push > 0.0 and y[X] >= self.values["rig.stroke"]):
            return -1.0
        return abs(push) - self.dry_friction(0.0)[0]

    def driving_force(self, t: float, y: Array) -> float:
        """All forces in N toward +x without dry friction."""
        p_amb, a_1, a_2 = (self.values[f"rig.{n}"] for n in ("ambient_pressure", "piston_area_1", "piston_area_2"))
        net = a_1 * (y[P1] - p_amb) - a_2 * (y[P2] - p_amb)
        return float(net + self.force(t) - self.values["friction.viscous"] * y[V])

    def dry_friction(self, v: float) -> tuple[float, float]:
        """Dry friction in N while speeding up (3.6) and while slowing (6.21)."""
        coulomb = self.values["friction.coulomb"]
        rising = coulomb
        if "stribeck.static" in self.values:
            rise = self.values["stribeck.static"] - coulomb
            rising += rise / (1.0 + (v / self.values["stribeck.velocity"]) ** 2)
        drop = self.values.get("friction-hysteresis.drop")
        if drop is None:
            return rising, rising
        lost = self.values.get("friction-hysteresis.viscous_drop", 0.0) * self.values["friction.viscous"] * abs(v)
        return rising, min(coulomb * (1.0 - drop) - lost, rising)

    def acceleration(self, t: float, y: Array, mode: float) -> float:
        """dv/dt in m/s^2."""
        rising, slowing = self.dry_friction(y[V])
        along = mode * self.driving_force(t, y)
        held = min(max(along, slowing), rising)
        return mode * (along - held) / self.values["rig.moving_mass"]

    def state_derivatives(self, t: float, y: Array, mode: float, areas: tuple[float, float]) -> list[float]:
        """Time derivatives of the state."""
        v = float(y[V]) if mode else 0.0
        a_1, a_2 = self.values["rig.piston_area_1"], self.values["rig.piston_area_2"]
        volume_1 = self.values["rig.dead_volume_1"] + a_1 * y[X]
        volume_2 = self.values["rig.dead_volume_2"] + a_2 * (self.values["rig.stroke"] - y[X])
        dp1, dt1 = self.chamber_derivatives(y[P1], y[T1], volume_1, a_1 * v, areas[0])
        dp2, dt2 = 0.0, 0.0
        if self.chamber_2 != "open":
            dp2, dt2 = self.chamber_derivatives(
                y[P2], y[T2], volume_2, -a_2 * v, areas[1] if self.chamber_2 == "valve" else 0.0
            )
        return [v, self.acceleration(t, y, mode) if mode else 0.0, dp1, dp2, dt1, dt2]

    def chamber_derivatives(
        self, p: float, temperature: float, volume: float, growth: float, area: float
    ) -> tuple[float, float]:
        """dp/dt and dT/dt of one chamber from the balances of mass and energy (2.14, 2.22)."""
        kappa, gas = self.values["rig.polytropic_exponent"], self.values["rig.gas_constant"]
        supplied = self.values["rig.gas_temperature"]
        q_in = self.mass_flow(max(area, 0.0), self.values["rig.supply_pressure"], p, supplied)
        q_out = self.mass_flow(max(-area, 0.0), p, self.values["rig.ambient_pressure"], temperature)
        heat = self.values["heat-transfer.conductance"] * (supplied - temperature) if self.has_heat_transfer else 0.0
        energy = kappa * (gas * (supplied * q_in - temperature * q_out) - p * growth) + (kappa - 1.0) * heat
        dp = energy / volume
        relative = dp / p + growth / volume - (q_in - q_out) * gas * temperature / (p * volume)
        return dp, temperature * relative if self.has_heat_transfer else 0.0

    def mass_flow(self, area: float, p_up: float, p_down: float, temperature: float) -> float:
        """Mass flow in kg/s through an effective area, none against the pressure (2.42, 2.46)."""
        ratio, b = p_down / p_up, self.values["valve.critical_ratio"]
        psi = 0.484 * math.sqrt(max(1.0 - (max(ratio - b, 0.0) / (1.0 - b)) ** 2, 0.0))
        kappa, gas = self.values["rig.heat_capacity_ratio"], self.values["rig.gas_constant"]
        choked = [math.sqrt(k / (k + 1.0)) * (2.0 / (k + 1.0)) ** (1.0 / (k - 1.0)) for k in (kappa, 1.4)]
        return float(area * p_up * psi * choked[0] / choked[1] * math.sqrt(2.0 / (gas * temperature)))


def _falling(event: Callable[[float, Array], float]) -> Callable[[float, Array], float]:
    """Return an event of scipy's that ends the integration where it falls through zero."""

    def wrapped(t: float, y: Array) -> float:
        return event(t, y)

    wrapped.terminal, wrapped.direction = True, -1.0  # type: ignore[attr-defined]
    return wrapped
