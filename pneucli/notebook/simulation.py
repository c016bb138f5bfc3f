"""``pneucli.simulate``: simulate the identified model under any command, or under that of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from pneucli.arrays import Array
from pneucli.errors import InputError, require_known
from pneucli.experiments import EXPERIMENT_KINDS
from pneucli.noise import NoiseModel
from pneucli.notebook.model import is_rotary
from pneucli.quantities import SIGNALS, axis_motion, axis_unit
from pneucli.recording import Recording
from pneucli.simulate.model import Model, with_parameters
from pneucli.simulate.open_loop import SAMPLING_PERIOD, free_run
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.preparation import prepare

if TYPE_CHECKING:
    from pneucli.notebook.run_data import RunData

Chamber2 = Literal["closed", "open", "valve"]
INPUTS = ("u", "u2", "p_supply")
STATE = ("x", "v", "p1", "p2")  # the state from which a run starts


def simulate(
    run: RunData,
    *,
    u: ArrayLike | None = None,
    u2: ArrayLike | None = None,
    p_supply: ArrayLike | None = None,
    time: ArrayLike | None = None,
    start: Mapping[str, float] | None = None,
    chamber_2: Chamber2 | None = None,
    experiment: str | None = None,
    recording: str | None = None,
    parameters: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    """Simulate the identified model under a command, or freely under the inputs of a recording.

    Args:
        run: The run of the pipeline.
        u: The command in V as it goes to the valve, shape (n,).
        u2: The command of a second valve in V, shape (n,).
        p_supply: The absolute supply pressure in Pa, shape (n,) or one value; default: that of the rig.
        time: The time stamps in s, shape (n,); default: 1 ms apart.
        start: The initial state: ``x`` in m, ``v`` in m/s, ``p1`` and ``p2`` in Pa absolute; default: at rest in
            mid-stroke at ambient pressure.
        chamber_2: ``"closed"``, ``"open"`` or ``"valve"``; default: by the arrangement of the valve.
        experiment: ``"axis"`` or ``"valve"`` (the vessel of a valve test); default: by the rig.
        recording: A recording, whose inputs and measured initial state replace all of the above.
        parameters: Values that replace those of the model, by name, in SI or the catalogue's unit.

    Returns:
        A row for each sample: time, inputs and channels, all SI; with ``recording`` also the measured channels as
        ``measured_p1`` and so on.

    Raises:
        InputError: The arguments contradict each other, or a name is unknown.

    """
    model = _with_parameter_values(run.model, parameters or {})
    if recording is not None:
        given = {"u": u, "u2": u2, "p_supply": p_supply, "time": time, "start": start}
        if any(value is not None for value in given.values()):
            raise InputError(
                "simulate", "a recording has its own inputs and start", "recording, or u and p_supply", code="E090"
            )
        return _free_run(run, model, recording)
    if u is None:
        raise InputError("simulate", "no command", "u=..., in V, or recording=...", code="E090")
    _require_valve(run)
    kind = experiment or ("axis" if model.rig.has_cylinder else "valve")
    simulated = [name for name, one in EXPERIMENT_KINDS.items() if one.simulated]
    require_known([kind], simulated, "simulate, experiment", code="E090")
    signals = _inputs({"u": u, "u2": u2, "p_supply": p_supply})
    stamps = _time_stamps(time, signals["u"].size)
    signals |= _initial_state(start or {}, model, kind, stamps.size)
    if chamber_2 is None:
        chamber_2 = "valve" if model.rig.arrangement.drives_both else "closed"
    imagined = Recording(
        "command",
        kind,  # type: ignore[arg-type]
        "test",
        stamps,
        signals,
        dict.fromkeys(signals, NoiseModel(0.0)),
        None if EXPERIMENT_KINDS[kind].vessel else chamber_2,
    )
    ready = prepare(imagined, model.rig, None)
    inputs: dict[str, Any] = {name: signals[name] for name in INPUTS if name in signals}
    return _frame({"time": stamps} | inputs | simulate_outputs(model, ready), rotary=is_rotary(run.artifacts))


def _require_valve(run: RunData) -> None:
    """Raise InputError where no recording of the run has a valve that lets gas through: a command would do nothing."""
    recordings = run.answer("ingest")["recordings"]
    if not any(EXPERIMENT_KINDS[one["experiment"]].simulated and not one["valve_shut"] for one in recordings):
        found = "this run has no valve: its recordings are of friction, or of a valve that is shut"
        raise InputError(
            "simulate, u", found, "recording=..., or a run with a valve test or an axis", "leave out u", code="E090"
        )


def _with_parameter_values(model: Model, values: Mapping[str, float]) -> Model:
    """Return the model with these values of model and valves; raises InputError for an unknown name."""
    available = {
        **model.base_values(),
        **model.values,
        **{name: value for name, (value, _) in model.valve_parameters().items()},
    }
    require_known(values, available, "simulate, parameters", '"{}" is no parameter', code="E091")
    return with_parameters(model, dict(values)) if values else model


def _inputs(given: Mapping[str, ArrayLike | None]) -> dict[str, Array]:
    signals: dict[str, Array] = {}
    size = np.size(given["u"])  # type: ignore[arg-type]
    for name, values in given.items():
        if values is None:
            continue
        array = np.asarray(values, dtype=np.float64)
        if array.ndim > 1 or array.size not in (1, size) or not np.isfinite(array).all():
            wanted = f"numbers, shape ({size},) or one value"
            raise InputError(f"simulate, {name}", f"shape {array.shape}, or what is no number", wanted, code="E090")
        signals[name] = np.array(np.broadcast_to(array.reshape(-1), (size,)))
    return signals


def _time_stamps(time: ArrayLike | None, size: int) -> Array:
    stamps = np.asarray(np.arange(size) * SAMPLING_PERIOD if time is None else time, dtype=np.float64)
    if stamps.shape != (size,) or size < 2 or not (np.diff(stamps) > 0.0).all():
        raise InputError(
            "simulate, time", f"shape {stamps.shape} or stamps that do not rise", f"({size},), at least 2", code="E090"
        )
    return stamps


def _initial_state(given: Mapping[str, float], model: Model, kind: str, size: int) -> dict[str, Array]:
    require_known(given, STATE, "simulate, start", '"{}" is no part of the state', code="E090")
    rig = model.rig
    state = {"p1": rig.ambient_pressure}
    if EXPERIMENT_KINDS[kind].cylinder:
        state |= {"p2": rig.ambient_pressure, "x": 0.5 * (rig.stroke or 0.0), "v": 0.0}
    state |= {name: float(value) for name, value in given.items()}
    return {name: np.full(size, value) for name, value in state.items()}


def _free_run(run: RunData, model: Model, name: str) -> pd.DataFrame:
    data = run.pipeline_data()
    by_name = {r.name: r for r in data.recordings}
    require_known([name], by_name, "simulate, recording", '"{}" is no recording', code="E091")
    found = free_run(model, prepare(by_name[name], data.rig, None), name)
    measured = {f"measured_{channel}": values for channel, values in found.measured.items()}
    return _frame({"time": found.time, **found.commands, **found.modelled, **measured}, rotary=is_rotary(run.artifacts))


def _frame(columns: Mapping[str, Any], *, rotary: bool) -> pd.DataFrame:
    found = pd.DataFrame(columns)
    with axis_motion(rotary=rotary):
        units = {name: axis_unit(SIGNALS[name.removeprefix("measured_")].unit) for name in columns}
    found.attrs["units"] = units
    return found
