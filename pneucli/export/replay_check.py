"""Compile the exported C and replay its test vectors: the difference between C and simulation."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.parameters import Controller
from pneucli.export import c_source
from pneucli.export.export_files import REPLAY_FILE, write_c
from pneucli.messages.simulate import ReplayCheck
from pneucli.simulate.model import Model

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
