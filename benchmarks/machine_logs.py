"""Logs of a running controller through the whole chain: ``python -m benchmarks.machine_logs [EFFECT ...]``. Needs gcc.

A healthy rig of the exam is recorded and identified, its controller exported. Then the rig has changed by one effect
of full size, and the exported C drives it from point to point and along a sine. The log (as its sensors read, u as
commanded, at every sample) is ingested, identified, compared and diagnosed beside the old valve tests, as a user would.
Printed: whether the verdict is right and the effect is named (or stands among those that cannot be told from a named
one), what was foretold of the loop and what came, and u against the replayed one over its noise.
``SEEDS`` rigs (default 2); ``CONTROLLER=unknown`` does not tell which controller ran, ``ACCELEROMETER=0`` logs none.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from benchmarks import small
from benchmarks.exam_loop import Exported, Trace, designed, driven
from pneucli.exam.cases import Case, generate_case, prepare_case
from pneucli.exam.conditions import Conditions
from pneucli.exam.hidden_effects import BY_NAME
from pneucli.exam.rig.parameters import Parameters
from pneucli.exam.rig.simulation import LOOP_PERIOD

NOTHING = "none"
ASKED = (
    NOTHING, "piston-leak", "valve-lag", "stribeck", "constant-force", "extra-mass", "valve-hysteresis", "presliding",
    "friction-asymmetry", "dead-volume", "line-delay", "pressure-offset", "friction-hysteresis", "chamber-leak",
)  # fmt: skip
SECONDS = 12.0
LOGS = (("log_1", "train"), ("log_2", "train"), ("log_3", "test"))
CONDITIONS = Conditions()
ACCELEROMETER = os.environ.get("ACCELEROMETER", "1") != "0"


def main_small() -> None:
    """Log one short run of a controller for the exact model, and ingest the log."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        generate_case(folder, "axis", (), "", 1.0, 1, CONDITIONS)
        small.shorten(folder / "pipeline.toml")
        case = prepare_case("rig", "axis", (), "", 1.0, 1, CONDITIONS)
        export = small.exported(folder / "out", case.laboratory)
        write_logs(folder, export, case, case.laboratory.parameters, "unknown", LOGS[-1:])
        recordings = answer(folder, "ingest")["recordings"]
    print(f"{len(recordings)} recordings, {sum(r['experiment'] == 'closed-loop' for r in recordings)} logs")


def main(arguments: list[str]) -> None:
    """Print a row for each rig and effect."""
    if small.SMALL in arguments:
        main_small()
        return
    controller = os.environ.get("CONTROLLER", "pneucli_controller.json")
    print("| effect | rig | verdict | named | right | error, train / test | foretold / measured, um | u |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for seed in range(1, 1 + int(os.environ.get("SEEDS", "2"))):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            generate_case(folder, "axis", (), "", 1.0, seed, CONDITIONS)
            case = prepare_case("rig", "axis", (), "", 1.0, seed, CONDITIONS)
            export = designed(folder)
            for name in arguments or ASKED:
                print(row(folder, export, case, name, seed, controller), flush=True)


def row(folder: Path, export: Path, case: Case, name: str, seed: int, controller: str) -> str:
    """Return a line of the table: one effect on one rig."""
    par = case.laboratory.parameters
    if name != NOTHING:
        par = BY_NAME[name].apply(par, 1.0, np.random.default_rng([seed, 7]))
    write_logs(folder, export, case, par, controller)
    found, compared = answer(folder, "diagnose"), answer(folder, "compare")
    named = [(c["effect"], c["indistinguishable_from"]) for c in found["candidates"] if c["effect"] in found["missing"]]
    is_named = any(name in (effect, *equals) for effect, equals in named)
    wanted = "adequate" if name == NOTHING else "missing-effect"
    right = found["verdict"] == wanted and (name == NOTHING or is_named)
    shown = ", ".join(f"{e} ({'/'.join(equals)})" if equals else e for e, equals in named)
    error = " / ".join(f"{compared['error'][use]:.2f}" for use in ("train", "test"))
    cells = (f"`{name}`", seed, found["verdict"], shown, right, error, told(compared), command(compared))
    return f"| {' | '.join(map(str, cells))} |"


def told(compared: Mapping[str, Any]) -> str:
    """Return the error at rest and on the way as foretold and as measured, on the log that was not fitted to."""
    logs = [log for log in compared.get("closed_loop", ()) if log["use"] == "test"]
    return "; ".join(
        f"{log[kind]['steady_um'] or 0:.3g} and {log[kind]['tracking_rms_um'] or 0:.3g}"
        for log in logs
        for kind in ("foretold", "measured")
    )


def command(compared: Mapping[str, Any]) -> str:
    """Return the largest ratio of u over its noise."""
    ratios = [c["ratio_to_noise"] for c in compared["channels"] if c["channel"] == "u"]
    return f"{max(ratios):.2f}" if ratios else "–"


def answer(folder: Path, stage: str) -> dict[str, Any]:
    """Return the answer of a stage to the logs' pipeline."""
    command = [sys.executable, "-m", "pneucli", stage, "logs.toml", "--json", "--quiet", "--out", "of-logs"]
    root = str(Path(__file__).parents[1])
    told = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": root}
    )
    if told.returncode > 1:
        raise RuntimeError(told.stderr)
    return dict(json.loads(told.stdout))


def write_logs(
    folder: Path,
    export: Path,
    case: Case,
    par: Parameters,
    controller: str,
    logs: Sequence[tuple[str, str]] = LOGS,
) -> None:
    """Let the exported controller drive the rig, and write its logs and the pipeline that reads them."""
    document = tomlkit.parse((folder / "pipeline.toml").read_text())
    recordings = tomlkit.aot()
    for table in document["recordings"]:
        if table["experiment"] == "valve":
            recordings.append(table)
    for i, (name, use) in enumerate(logs):
        reference = moves(par, i)
        trace = driven(
            par, case.laboratory.sensors, Exported(export), reference, np.zeros(reference.size), False, seed=i
        )
        columns(trace, reference, par).to_csv(folder / "raw" / f"{name}.csv", index=False)
        about = {"name": name, "file": f"raw/{name}.csv", "experiment": "closed-loop", "use": use}
        ran = controller if controller == "unknown" else str(export / controller)
        recordings.append(tomlkit.item(about | {"controller": ran, "chamber_2": "closed"}))
    document["recordings"] = recordings
    document["signals"]["x_ref"] = {"column": "X_ref [mm]", "unit": "mm"}  # type: ignore[index]
    if not case.laboratory.supply_recorded:
        document["signals"].pop("p_supply", None)  # type: ignore[union-attr]
    if not ACCELEROMETER:
        document["signals"].pop("a", None)  # type: ignore[union-attr]
    (folder / "logs.toml").write_text(tomlkit.dumps(document))


def moves(par: Parameters, i: int) -> np.ndarray:
    """Return what a log asks for in m: way points, then a sine."""
    rng, time = np.random.default_rng([i, 3]), LOOP_PERIOD * np.arange(round(SECONDS / LOOP_PERIOD))
    points = np.concatenate([[0.5], rng.uniform(0.3, 0.7, 3)])
    reference = points[np.minimum((time / 2.0).astype(int), 3)]
    sine = points[3] + rng.uniform(0.05, 0.12) * np.sin(2 * np.pi * rng.uniform(0.3, 0.8) * (time - 8.0))
    return par.stroke * np.where(time < 8.0, reference, sine)


def columns(trace: Trace, reference: np.ndarray, par: Parameters) -> pd.DataFrame:
    """Return a log as the machine's program writes it: what the controller read and what it commanded."""
    gauge = 1e-5 * (trace.read[:, 1:] - par.ambient)
    return pd.DataFrame(
        {
            "t [ms]": 1e3 * LOOP_PERIOD * np.arange(reference.size),
            "X_ref [mm]": np.round(1e3 * reference, 6),
            "U_valve [V]": np.round(trace.u, 6),
            "P_supply [bar]": np.round(1e-5 * (trace.supply - par.ambient), 5),
            "P1 [bar]": np.round(gauge[:, 0], 5),
            "P2 [bar]": np.round(gauge[:, 1], 5),
            "Pos [mm]": np.round(1e3 * trace.read[:, 0], 6),
        }
        | ({"Acc [m/s2]": np.round(trace.a, 5)} if ACCELEROMETER else {})
    )


if __name__ == "__main__":
    main(sys.argv[1:])
