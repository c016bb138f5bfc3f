"""The export's files: C with its test vectors and their replay through the compiled C, MATLAB and CSV."""

import io
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from pneucli.arrays import Array
from pneucli.closed_loop.scenarios import equilibrium_at
from pneucli.closed_loop.simulation import ClosedLoopSetup, Run, Scenario, simulate
from pneucli.controller import layout
from pneucli.controller.parameters import Controller
from pneucli.export import c_source, controller_program, structured_text
from pneucli.export.controller_program import PREFIX, named
from pneucli.export.single_precision import run_in_single_precision
from pneucli.io.artifacts import atomic_path, write_text
from pneucli.messages.export import PrecisionCost
from pneucli.messages.simulate import ReplayCheck
from pneucli.simulate.model import Model

Columns = Mapping[str, NDArray[Any] | list[str]]
REPLAY_FILE, REPLAY_ST_FILE = "pneucli_replay.csv", "pneucli_replay_st.csv"
REPLAY_COLUMNS = ("x_ref", "x", "p1", "p2", "u1", "u2", "supply", "duty", "level")
REPLAY_DURATION, COMMISSIONING_DURATION = 60.0, 8.0  # s, of the minute and of the commissioning behind it


def replay_scenario(controller: Controller) -> Scenario:
    """Return a minute that passes through every branch, and a commissioning behind it.

    Rest, steps, a sine, loads, drop-outs, what is out of reach; a supply that sags; another pressure level; hold, off,
    and a start from there. After the commissioning a step, and a second one that is stopped.
    """
    v = controller.values
    time = np.arange(0.0, REPLAY_DURATION + COMMISSIONING_DURATION, controller.period)
    centre, amplitude = 0.5 * v["C_STROKE"], 0.15 * v["C_STROKE"]
    steps = amplitude * np.sign(np.sin(2 * np.pi * time / 7.0)) * (time > 1.0)
    sine = amplitude * np.sin(2 * np.pi * 0.5 * time)
    out_of_reach = np.where((time > 50.0) & (time < 53.0), 0.98 * v["C_STROKE"] - centre, 0.0)
    offset = np.where(time < 21.0, steps, np.where(time < 40.0, sine, out_of_reach))
    offset += 0.3 * amplitude * (time > REPLAY_DURATION + 4.0)
    push = 0.1 * v["C_AREA_1"] * (v["C_SUPPLY"] - v["C_AMBIENT"])
    force = push * (np.sign(np.sin(2 * np.pi * time / 11.0)) * ((time > 41.0) & (time < 49.0)) - (time > 55.0))
    lost = (("p1", 9.0, 9.05), ("x", 16.0, 16.02), ("p2", 25.0, 30.0), ("x", 58.0, 58.3))
    supply = v["C_SUPPLY"] - 0.15 * (v["C_SUPPLY"] - v["C_AMBIENT"]) * ((time > 12.0) & (time < 20.0))
    duty = np.zeros(time.size)
    duty[(time > 28.3) & (time < 29.2)] = layout.OPERATING_MODES.index("hold")
    duty[(time > 45.0) & (time < 46.0)] = layout.OPERATING_MODES.index("off")
    duty[np.argmax(time >= 34.0)] = layout.OPERATING_MODES.index("reset")
    for begin in (0.1, COMMISSIONING_DURATION - 1.5):
        duty[np.argmax(time >= REPLAY_DURATION + begin)] = layout.OPERATING_MODES.index("commission")
    duty[time > REPLAY_DURATION + COMMISSIONING_DURATION - 0.7] = layout.OPERATING_MODES.index("off")
    level = np.where((time > 22.0) & (time < 27.0), 0.7 * v["C_P_MEAN"] + 0.3 * v["C_P_HIGH"], 0.0)
    start = equilibrium_at(v, centre)
    return Scenario(
        "replay",
        centre + offset,
        force,
        np.asarray(supply, dtype=np.float64),
        start,
        lost,
        operating_mode=duty,
        level=level,
    )


def replay_vectors(result: Run) -> dict[str, Array]:
    """Return what the controller read and answered, by the columns of the replay file, each of shape ``(n,)``."""
    readings = (layout.L_READ_X, layout.L_READ_P1, layout.L_READ_P2)
    places = (*readings, layout.L_U1, layout.L_U2, layout.L_SUPPLY, layout.L_MODE, layout.L_LEVEL)
    logged = dict(zip(REPLAY_COLUMNS[1:], result.log[:, places].T, strict=True))
    return {"x_ref": result.scenario.reference, **logged}


def run_replay(controller: Controller, model: Model, bench: ClosedLoopSetup) -> Run:
    """Return the minute of the replay, in which the supply is measured."""
    return simulate(model, controller, replay_scenario(controller), replace(bench, supply=True))


def write_c_source(
    folder: Path, controller: Controller, pipeline: str, precision: str = "float64", prefix: str = PREFIX
) -> None:
    """Write header and source alone."""
    for ending, text in (("h", c_source.header), ("c", c_source.source)):
        name = named(f"{c_source.BASE_NAME}.{ending}", prefix)
        write_text(folder / name, text(controller, pipeline, precision, prefix))


def write_c(
    folder: Path,
    controller: Controller,
    model: Model,
    bench: ClosedLoopSetup,
    pipeline: str,
    precision: str = "float64",
    prefix: str = PREFIX,
) -> PrecisionCost | None:
    """Write header, source, test vectors and the program that replays them, all named with the prefix.

    The vectors hold what this precision commands. Return by how much samples differ from those in double
    precision; None where that is what it has.
    """
    write_c_source(folder, controller, pipeline, precision, prefix)
    write_text(folder / named(c_source.REPLAY_FILE, prefix), c_source.replay_program(precision, prefix))
    vectors, found = replay_vectors(run_replay(controller, model, bench)), None
    if precision == "float32":
        commands, found = run_in_single_precision(controller, vectors)
        vectors |= {"u1": commands[:, 0], "u2": commands[:, 1]}
    write_csv(folder / named(REPLAY_FILE, prefix), vectors)
    return found


def write_st(
    folder: Path,
    controller: Controller,
    model: Model,
    bench: ClosedLoopSetup,
    pipeline: str,
    prefix: str = PREFIX,
) -> None:
    """Write the structured text and its test vectors, named with the prefix."""
    write_text(folder / named(structured_text.FILE_NAME, prefix), structured_text.source(controller, pipeline, prefix))
    write_csv(folder / named(REPLAY_ST_FILE, prefix), replay_vectors(run_replay(controller, model, bench)))


def write_replay(folder: Path, controller: Controller, pipeline: str, precision: str) -> None:
    """Write the controller as the file that a log of it names."""
    write_text(folder / controller_program.FILE_NAME, controller_program.to_json(controller, pipeline, precision))


def write_csv(path: Path, table: Columns) -> None:
    """Write columns with a header line; numbers so that they are read back to the last bit."""
    text = io.StringIO()
    text.write(",".join(table) + "\n")
    for row in zip(*(list(column) for column in table.values()), strict=True):
        text.write(",".join(v if isinstance(v, str) else repr(float(v)) for v in row) + "\n")
    write_text(path, text.getvalue())


def write_mat(path: Path, controller: Controller, tables: Mapping[str, Columns]) -> None:
    """Write a MATLAB file (v5): the controller's numbers and inverse tables, and each table as a struct of columns."""
    numbers = {name.removeprefix("C_").lower(): value for name, value in controller.values.items()}
    content: dict[str, Any] = {
        "controller": {**numbers, **{name: np.array(table) for name, table in controller.tables().items()}}
    }
    for name, table in tables.items():
        content[name] = {k: np.array(v, dtype=object) if isinstance(v, list) else v for k, v in table.items()}
    with atomic_path(path) as temporary:
        savemat(temporary, content, long_field_names=True, oned_as="column")


def controller_table(controller: Controller) -> dict[str, NDArray[Any] | list[str]]:
    """Return the controller's numbers as a table of name and value."""
    names = [name for name in layout.PARAMETERS if name in controller.values]
    return {"name": names, "value": np.array([controller.values[name] for name in names])}


def inverse_table(controller: Controller) -> dict[str, NDArray[Any] | list[str]]:
    """Return the valve's inverse: effective area (m^2, vented ones negative) and the command in V that opens it.

    Where a second valve drives chamber 2 its inverse follows, and a column tells the ``chamber``.
    """
    values, share = controller.values, np.linspace(0.0, 1.0, len(controller.fill)) ** 2
    sides = [("C_AREA_VENT", "C_AREA_FILL", controller.vent, controller.fill)]
    if values["C_TWO_VALVES"] > 0.5:
        sides.append(("C_AREA_VENT_2", "C_AREA_FILL_2", controller.vent_2, controller.fill_2))
    areas = [np.concatenate([-share[::-1] * values[vent], share * values[fill]]) for vent, fill, _, _ in sides]
    table = {"area": np.concatenate(areas), "u": np.concatenate([[*vent[::-1], *fill] for _, _, vent, fill in sides])}
    chamber = {"chamber": np.repeat([1.0, 2.0], 2 * share.size)} if len(sides) > 1 else {}
    return {**chamber, **table}


COMPILERS = ("cc", "gcc", "clang")  # the first that is found compiles
COMPILE_OPTIONS = ("-std=c11", "-O2")  # of docs/export.md
MAX_DIFFERENCE = 1e-9  # V: the limit of pneucli_replay.c
COMPILE_TIMEOUT, REPLAY_TIMEOUT = 120.0, 120.0  # s


def replay_exported_c(controller: Controller, model: Model, setup: ClosedLoopSetup, pipeline: str) -> ReplayCheck:
    """Write the C of a controller to a temporary folder, compile it, and replay a minute of test vectors.

    Args:
        controller: The controller to export.
        model: The identified model, which gives the readings of the test vectors.
        setup: Noise, quanta and delay of the sensors.
        pipeline: Name of the pipeline, for the head of the C.

    Returns:
        The difference, or the reason without one: no compiler, or a failure of the compiler or the program.

    """
    compiler = next((path for name in COMPILERS if (path := shutil.which(name))), None)
    if compiler is None:
        return ReplayCheck(None, reason=f"no C compiler ({', '.join(COMPILERS)})")
    with tempfile.TemporaryDirectory(prefix="pneucli-replay-") as place:
        folder = Path(place)
        write_c(folder, controller, model, setup, pipeline)
        return compile_and_replay(folder, compiler)


def compile_and_replay(folder: Path, compiler: str) -> ReplayCheck:
    """Compile the exported C of a folder with its replay program and run it on the replay file of that folder."""
    sources = [str(folder / c_source.REPLAY_FILE), str(folder / f"{c_source.BASE_NAME}.c")]
    program = str(folder / "replay")
    try:
        subprocess.run(
            [compiler, *COMPILE_OPTIONS, *sources, "-lm", "-o", program],
            check=True, capture_output=True, text=True, timeout=COMPILE_TIMEOUT,
        )  # fmt: skip
        completed = subprocess.run(
            [program, str(folder / REPLAY_FILE)], check=False, capture_output=True, text=True, timeout=REPLAY_TIMEOUT
        )
        samples, difference, *_ = completed.stdout.split()
        return ReplayCheck(float(difference), int(samples))
    except subprocess.CalledProcessError as error:
        return ReplayCheck(None, reason=f"{compiler} failed: {error.stderr.strip()[-300:]}")
    except (subprocess.TimeoutExpired, OSError, ValueError) as error:
        return ReplayCheck(None, reason=f"the replay failed: {error}")
