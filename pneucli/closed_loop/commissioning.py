"""The family of gains of a commissioning, and what its relay test measures: on the model with lags and delays added.

Each member is designed for the model with one more lag or delay between command and pressure; what the relay test of
the controller reads on that model, simulated, is what a machine must read to get its gains.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from pneucli.arrays import Array
from pneucli.closed_loop.ensemble import (
    POSITION_SHARES,
    Choice,
    RigEnsemble,
    RigTest,
    chosen_requirements,
    measured_times,
    search,
    spool_lag,
)
from pneucli.closed_loop.scenarios import equilibrium_at
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate
from pneucli.controller import layout
from pneucli.controller.layout import DELAY_LINE_SAMPLES
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.requirements import Requirements
from pneucli.executors import map_in_threads, thread_count
from pneucli.messages.compare import Commissioned
from pneucli.physics.declaration import consists_of_times
from pneucli.physics.effects import catalogue
from pneucli.simulate.model import Model

ADDED = (2.5e-3, 5e-3, 7.5e-3, 10e-3, 15e-3, 20e-3, 30e-3)  # s, of each of both
# with a faster position loop late sensors, which a relay cannot tell from lag or hose, track by millimetres
MEMBER_SHARES = POSITION_SHARES[:2]
MEMBER_RIGS = 3  # rigs, beside the model, of the search of each member on an ensemble
LONGEST_TEST = 6.0  # s, of the simulated commissioning
BEGIN = 0.1  # s: when it is asked for
STATES = {
    0: "as designed",
    1: "valves shut",
    2: "relay test of valve 1",
    3: "relay test of valve 2",
    4: "commissioned",
    5: "slower after a limit cycle",
    6: "a limit cycle persists",
    10: "stopped",
    11: "limit of travel",
    12: "limit of pressure",
    13: "no reversal of the pressure",
    14: "a reading is missing",
    15: "a reading is too noisy",
    16: "the pressure goes against the command",
    17: "the pressure's rate is not the model's",
}  # of the state chart of :mod:`pneucli.controller.commissioning`
SHUT = {words for number, words in STATES.items() if number >= 10}  # those in which the valves stay shut


def commissioned(states: Array) -> Commissioned:
    """Return what the states of a controller (:mod:`pneucli.controller.layout`) tell of its commissioning."""
    s = [float(value) for value in states]
    return Commissioned(
        state=STATES[int(s[layout.S_COMMISSIONING])],
        null_1=s[layout.S_NULL_FOUND1],
        null_2=s[layout.S_NULL_FOUND2],
        delay=s[layout.S_DELAY_FOUND],
        overshoot=s[layout.S_OVERSHOOT_FOUND],
        gain=s[layout.S_GAIN_FOUND],
        member=int(s[layout.S_MEMBER]),
        swing=s[layout.S_SWING_AMPLITUDE],
        swing_period=s[layout.S_SWING_PERIOD],
    )


@cache
def added_times() -> tuple[tuple[str, str], tuple[str, str]]:
    """Return effect and parameter of the lag and of the delay that a machine may have more than its model.

    They are the effects of most rigs that consist of times between command and spool, and between spool and chamber.
    """
    flow = next(e for e in catalogue().values() if e.untold and consists_of_times(e) and "flow_delay" in e.ports)
    lag, delay = ((effect.name, effect.parameters[0].name) for effect in (spool_lag(), flow))
    return lag, delay


def run_commissioning(model: Model, controller: Controller, setup: ClosedLoopSetup, seed: int = 0) -> Run:
    """Simulate a commissioning in the middle of the stroke, with the axis at rest."""
    c, n = controller.values, round(LONGEST_TEST / controller.period)
    mode = np.zeros(n)
    mode[round(BEGIN / controller.period)] = layout.OPERATING_MODES.index("commission")
    centre = 0.5 * c["C_STROKE"]
    scenario = Scenario(
        "commissioning", np.full(n, centre), np.zeros(n), np.full(n, c["C_SUPPLY"]), equilibrium_at(c, centre),
        operating_mode=mode,
    )  # fmt: skip
    return simulate(model, controller, scenario.supplied_by(model, controller), setup, seed)


def with_commissioning(
    model: Model, controller: Controller, make: Callable[[Model], Controller], setup: ClosedLoopSetup
) -> Controller:
    """Return the controller with the family of gains from which a commissioning chooses.

    Args:
        model: The identified model.
        controller: The controller as designed.
        make: Designs a controller for a model.
        setup: Sensors and delay.

    Returns:
        The controller. Its members are those for the model, and for a lag or a delay of ``ADDED`` more, the longer one
        after the shorter one; those whose relay test fails in simulation, or whose delay is longer than the delay
        line, are left out.
    """
    longest = (DELAY_LINE_SAMPLES - 2) * controller.period
    models = [model, *(with_time(model, *kind, time) for kind in added_times() for time in ADDED)]
    models = [one for one in models if one.values.get(".".join(added_times()[1]), 0.0) <= longest]

    def tested(slower: Model) -> Commissioned:
        return commissioned(run_commissioning(slower, controller, setup).states)

    found = map_in_threads(tested, models, thread_count())
    ended = [
        (slower, one) for slower, one in zip(models, found, strict=True) if one.delay > 0.0 and one.state not in SHUT
    ]
    return controller.with_family([(one.delay, one.overshoot, make(slower)) for slower, one in ended])


def member_on_ensemble(
    ensemble: RigEnsemble,
    slower: Model,
    wanted: Requirements,
    sealed: float | None,
    test: RigTest,
    setup: ClosedLoopSetup,
) -> Controller:
    """Return the gains that hold best on rigs of an ensemble whose times are those of ``slower``: they are measured.

    ``sealed``: pressure in Pa of a closed chamber 2 at mid-stroke.
    """

    def make(choice: Choice) -> Controller:
        return design_cascade(*chosen_requirements(choice, slower, wanted), sealed)

    family = [Choice(0.0, 1.0, share) for share in MEMBER_SHARES]
    return make(search(measured_times(ensemble, slower), make, setup, test, family, count=MEMBER_RIGS))


def with_time(model: Model, name: str, key: str, time: float) -> Model:
    """Return a model with an effect whose time (s) is longer by ``time``."""
    effects = model.effects if any(e.name == name for e in model.effects) else (*model.effects, catalogue()[name])
    known = model.values.get(f"{name}.{key}", 0.0) if effects is model.effects else 0.0
    return replace(model, effects=effects).with_values({f"{name}.{key}": known + time})
