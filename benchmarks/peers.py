"""Peers side by side on recordings with truth: ``python -m benchmarks.peers [--seeds N]``. Installs its peers itself.

An axis of the exam with a leak across the piston: a test of the valve with a vessel, and driven recordings with a
closed chamber 2. Unknown are mass, Coulomb and viscous friction, the valve's area at 10 V and the leak; everybody is
told the same of the rig, which effects act, and the same checked signals in SI. A package index is needed once:
pysindy and mujoco go into a virtual environment of their own that is removed at the end.

- ``pysindy``: a library of the right terms, the accelerometer as derivative of the velocity, no samples at rest
- ``mujoco``: its system identification with its cylinder actuator, commanded by the net force of the pressures
- ``kalman``: an extended Kalman filter whose state holds the logarithms of the parameters, two passes; it and
  ``greyest`` know that the area is a power of the opening
- ``weak form``: balances times test functions, integrated by parts, least squares
- ``greyest``: a grey-box model in scipy: short simulations from the readings, friction smoothed, ``least_squares``
- ``pneucli``: ``identify``

Printed are errors of the parameters in per cent, and held-out errors of the program's model with a peer's values,
times what the true model shows: of the motion under the measured pressures (restarted every 0.5 s), and of the pressure
of a valve test. Nobody saw these recordings. Then processor seconds (imports and compilation left out), and lines that
a user writes, the flow function and the balances among them where a peer has none.
"""

import argparse
import inspect
import json
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pneucli.arrays import Array

Signals = dict[str, Array]
PINNED = ("numpy==2.4.6", "pysindy==2.1.0", "mujoco[sysid]==4.0.0")
PARAMETERS = ("mass", "coulomb", "viscous", "area", "leak")
KNOTS = (0.0, 0.03, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)  # of the largest command
KAPPA, RT, HORIZON = 1.4, 287.0 * 293.15, 200  # samples that a short simulation takes
Fit = dict[str, Any]  # the parameters; "map": commands in V and areas in m^2


# What a user writes who has no library of pneumatics: the flow function, and the balances of both chambers.


def flow(up: Array, down: Array) -> Array:
    """Return kg/(s m^2) through an orifice (ISO 6358, b = 0.528)."""
    ratio = np.clip((down / up - 0.528) / 0.472, 0.0, 1.0)
    return np.asarray(0.484 * np.sqrt(2.0 / RT) * up * np.sqrt(1.0 - ratio**2))


def terms(s: Signals, rig: Mapping[str, float]) -> Signals:
    """Return flows over area (filling, venting, from chamber 1 to 2), volumes, and the hats of the map."""
    top, u = rig["top"], s["u"]
    both = s["p2"] if "p2" in s else s["p1"]
    return {
        "fill": np.where(u > 0.0, flow(s["p_supply"], s["p1"]), 0.0),
        "vent": np.where(u < 0.0, flow(s["p1"], np.full(u.size, rig["ambient"])), 0.0),
        "leak": flow(np.maximum(s["p1"], both), np.minimum(s["p1"], both)) * np.sign(s["p1"] - both),
        "V1": rig["V1"] + rig["A1"] * s["x"] if "x" in s else np.full(u.size, rig["vessel"]),
        "V2": rig["V2"] + rig["A2"] * (rig["stroke"] - s["x"]) if "x" in s else np.full(u.size, 1.0),
        "hats": np.array([np.interp(np.abs(u), top * np.array(KNOTS), row) for row in np.eye(len(KNOTS))[1:]]),
    }


def push(s: Signals, rig: Mapping[str, float]) -> Array:
    """Return the net force of both pressures in N."""
    return np.asarray(rig["A1"] * (s["p1"] - rig["ambient"]) - rig["A2"] * (s["p2"] - rig["ambient"]))


def velocity(x: Array, dt: float) -> Array:
    """Return the slope of a line through 21 samples."""
    return np.convolve(np.pad(x, 10, mode="edge"), np.arange(10.0, -11.0, -1.0) / (770.0 * dt), "valid")


def as_map(top: float, areas: Array, overlap: float = 0.0) -> tuple[list[float], list[float], float]:
    return [top * k for k in KNOTS[1:]], [float(a) for a in areas], overlap


# The peers.


def pysindy(data: list[Signals], rig: Mapping[str, float]) -> Fit:
    import pysindy as ps

    def fit(x: list[Array], slope: list[Array], columns: list[Array]) -> Array:
        count = columns[0].shape[1]
        linear = ps.PolynomialLibrary(degree=1, include_bias=False)
        library = ps.GeneralizedLibrary([linear], inputs_per_library=[list(range(1, count + 1))])
        model = ps.SINDy(ps.STLSQ(threshold=0.0, alpha=0.0), library)
        model.fit([one[:, None] for one in x], t=rig["dt"], x_dot=[one[:, None] for one in slope], u=columns)
        return np.asarray(model.coefficients()[0])

    smooth = ps.SmoothedFiniteDifference()
    states, slopes, columns, speeds, accelerations, forces = [], [], [], [], [], []
    for s in data:
        f, scale = terms(s, rig), 1e-9  # areas in mm^2 per 1e-3: all columns of one size
        v = velocity(s["x"], rig["dt"]) if "x" in s else np.zeros(s["u"].size)
        c = scale * KAPPA * RT / f["V1"]
        swept = KAPPA * s["p1"] * rig["A1"] * v / f["V1"] if "x" in s else 0.0
        dp1 = smooth._differentiate(s["p1"][:, None], rig["dt"])[:, 0] + swept
        states.append(s["p1"])
        slopes.append(dp1)
        columns.append(np.array([*(c * f["fill"] * f["hats"]), *(-c * f["vent"] * f["hats"]), -c * f["leak"]]).T)
        if "x" in s:
            moving = np.abs(v) > 5e-3
            speeds.append(v[moving])
            accelerations.append(s["a"][moving])
            forces.append(np.array([push(s, rig), v, np.sign(v)]).T[moving])
    gas = scale * fit(states, slopes, columns)
    per_mass, viscous, coulomb = fit(speeds, accelerations, forces)
    areas, n = 0.5 * (gas[: len(KNOTS) - 1] + gas[len(KNOTS) - 1 : -1]), len(KNOTS) - 1
    return {
        "mass": 1.0 / per_mass, "coulomb": -coulomb / per_mass, "viscous": -viscous / per_mass,
        "area": areas[n - 1], "leak": gas[-1], "map": as_map(rig["top"], areas),
    }  # fmt: skip


def mujoco(data: list[Signals], rig: Mapping[str, float]) -> Fit:
    import mujoco as mj
    from mujoco import sysid

    spec = mj.MjSpec.from_string(f"""<mujoco><option timestep="{rig["dt"]}" gravity="0 0 0"/>
        <worldbody><body name="piston"><joint name="x" type="slide" axis="1 0 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
        <actuator><cylinder name="cylinder" joint="x" area="1" timeconst="0.001"/></actuator>
        <sensor><jointpos name="position" joint="x"/></sensor></mujoco>""")
    changes = {
        "mass": lambda s, p: setattr(s.body("piston"), "mass", p.value[0]),
        "frictionloss": lambda s, p: setattr(s.joint("x"), "frictionloss", p.value[0]),
        "damping": lambda s, p: setattr(s.joint("x"), "damping", [p.value[0], 0.0, 0.0]),  # a polynomial of the speed
    }
    params = sysid.ParameterDict()
    for (name, change), (low, start, high) in zip(
        changes.items(), ((0.3, 1.5, 30.0), (0.0, 5.0, 100.0), (0.0, 30.0, 500.0)), strict=True
    ):
        params.add(sysid.Parameter(name, nominal=start, min_value=low, max_value=high, modifier=change))
    model, starts, commands, readings = spec.compile(), [], [], []
    for s in (one for one in data if "x" in one):
        v, force = velocity(s["x"], rig["dt"]), push(s, rig)
        for k in range(0, s["x"].size - HORIZON - 1, HORIZON):
            t = rig["dt"] * np.arange(HORIZON)
            starts.append(sysid.create_initial_state(model, s["x"][[k]], v[[k]], force[[k]]))
            commands.append(sysid.TimeSeries(t, force[k : k + HORIZON, None]))
            positions = s["x"][k + 1 : k + HORIZON, None]
            readings.append(sysid.TimeSeries.from_names(t[1:], positions, model))
    names = [f"part {k}" for k in range(len(starts))]
    group = sysid.ModelSequences("axis", spec, names, starts, commands, readings)
    residual = sysid.build_residual_fn(models_sequences=[group])
    found, _ = sysid.optimize(initial_params=params, residual_fn=residual, verbose=False)
    return {
        "mass": found["mass"].value[0], "coulomb": found["frictionloss"].value[0], "viscous": found["damping"].value[0],
    }  # fmt: skip


def weak_form(data: list[Signals], rig: Mapping[str, float]) -> Fit:
    width, stride = 41, 10
    z = np.linspace(-1.0, 1.0, width + 2)[1:-1]
    bump = (1.0 - z**2) ** 2 / np.sum((1.0 - z**2) ** 2)
    slope = -8.0 * z * (1.0 - z**2) / ((width + 1) * np.sum((1.0 - z**2) ** 2) * rig["dt"])

    def windows(values: Array) -> Array:
        return np.lib.stride_tricks.sliding_window_view(values, width)[::stride]

    def solved(parts: list[tuple[Array, Array]]) -> Array:
        errors, found = [float(np.std(y)) + 1e-30 for _, y in parts], np.zeros(0)
        for _ in range(8):
            design = np.concatenate([x / e for (x, _), e in zip(parts, errors, strict=True)])
            side = np.concatenate([y / e for (_, y), e in zip(parts, errors, strict=True)])
            size = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
            found = np.linalg.lstsq(design / size, side, rcond=1e-9)[0] / size
            errors = [float(np.std(y - x @ found)) for x, y in parts]
        return found

    gas, forces = [], []
    for s in data:
        f = terms(s, rig)
        v = velocity(s["x"], rig["dt"]) if "x" in s else np.zeros(s["u"].size)
        leak = f["leak"] if "x" in s else np.zeros(s["u"].size)
        columns = [*(f["fill"] * f["hats"]), *(-f["vent"] * f["hats"]), -leak]

        def gas_side(p: Array, volume: Array, swept: Array) -> Array:
            change = -(windows(p * volume) @ slope)
            return np.asarray((change / KAPPA + (1.0 - 1.0 / KAPPA) * (windows(p * swept) @ bump)) / RT)

        low = np.where(s["u"] > 0.0, s["p1"] / s["p_supply"], np.where(s["u"] < 0.0, rig["ambient"] / s["p1"], 0.0))
        certain = windows(low).max(axis=1) < 0.95  # near 1 the flow is infinitely steep
        design = np.array([windows(c) @ bump for c in columns]).T
        gas.append((design[certain], gas_side(s["p1"], f["V1"], rig["A1"] * v if "x" in s else v)[certain]))
        if "x" in s:
            into = np.zeros((design.shape[0], design.shape[1]))
            into[:, -1] = windows(leak) @ bump
            gas.append((into, gas_side(s["p2"], f["V2"], -rig["A2"] * v)))
            sure = (windows(v).min(axis=1) > 5e-3) | (windows(v).max(axis=1) < -5e-3)
            three = np.array([windows(c) @ bump for c in (s["a"], np.sign(v), v)]).T
            forces.append((three[sure], (windows(push(s, rig)) @ bump)[sure]))
    found, (mass, coulomb, viscous) = solved(gas), solved(forces)
    n = len(KNOTS) - 1
    areas = 0.5 * (found[:n] + found[n : 2 * n])
    fit = {"mass": mass, "coulomb": coulomb, "viscous": viscous, "area": areas[-1], "leak": found[-1]}
    return fit | {"map": as_map(rig["top"], areas)}


def rates(state: Array, q: Signals, i: int, theta: Array, rig: Mapping[str, float]) -> Array:
    """Return d(x, v, p1, p2)/dt, friction smoothed; theta: mass, coulomb, viscous, area, leak, overlap, exponent."""
    x, v, p1, p2 = state
    mass, coulomb, viscous, area, leak, overlap, power = theta
    u, supply, ambient = q["u"][i], q["p_supply"][i], rig["ambient"]
    opening = area * np.clip((np.abs(u) - overlap) / (rig["top"] - overlap), 0.0, 1.0) ** power
    into = opening * np.where(u > 0.0, flow(supply, p1), np.where(u < 0.0, -flow(p1, ambient + 0.0 * p1), 0.0))
    across = q["piston"] * leak * flow(np.maximum(p1, p2), np.minimum(p1, p2)) * np.sign(p1 - p2)
    V1 = q["piston"] * (rig["V1"] + rig["A1"] * x) + (1.0 - q["piston"]) * rig["vessel"]
    V2 = rig["V2"] + rig["A2"] * (rig["stroke"] - x)
    force = rig["A1"] * (p1 - ambient) - rig["A2"] * (p2 - ambient) - viscous * v - coulomb * np.tanh(v / 1e-3)
    return np.array([
        v, q["piston"] * force / mass,
        KAPPA * (RT * (into - across) - q["piston"] * p1 * rig["A1"] * v) / V1,
        q["piston"] * KAPPA * (RT * across + p2 * rig["A2"] * v) / V2,
    ])  # fmt: skip


def stepped(state: Array, q: Signals, i: int, theta: Array, rig: Mapping[str, float]) -> Array:
    """Return the state after one sample: four steps, the smoothed Coulomb friction implicit."""
    h = 0.25 * rig["dt"]
    for _ in range(4):
        slope = rates(state, q, i, theta, rig)
        stiff = q["piston"] * (theta[1] / (1e-3 * np.cosh(np.clip(state[1] / 1e-3, -20.0, 20.0)) ** 2) + theta[2])
        slope[1] = slope[1] / (1.0 + h * stiff / theta[0])
        state = state + h * slope
    return state


def greyest(data: list[Signals], rig: Mapping[str, float]) -> Fit:
    from scipy.optimize import least_squares

    parts: list[dict[str, Any]] = []
    for s in data:
        v = velocity(s["x"], rig["dt"]) if "x" in s else np.zeros(s["u"].size)
        for k in range(0, s["u"].size - HORIZON - 1, HORIZON):
            part = {name: s[name][k : k + HORIZON + 1] for name in ("u", "p_supply", "p1")}
            there = "x" in s
            parts.append(part | {"piston": float(there), "v": v[k], "x": s["x"][k : k + HORIZON + 1] if there else None,
                                 "p2": s["p2"][k : k + HORIZON + 1] if there else None})  # fmt: skip
    still = np.full(HORIZON + 1, 0.1), np.full(HORIZON + 1, rig["ambient"])
    q = {name: np.array([one[name] for one in parts]).T for name in ("u", "p_supply", "p1")}
    q["piston"] = np.array([one["piston"] for one in parts])
    q["x"] = np.array([still[0] if one["x"] is None else one["x"] for one in parts]).T
    q["p2"] = np.array([still[1] if one["p2"] is None else one["p2"] for one in parts]).T
    start = np.array([q["x"][0], [one["v"] for one in parts], q["p1"][0], q["p2"][0]])

    def residual(z: Array) -> Array:
        theta, state, out = np.exp(z), start, []
        for i in range(HORIZON):
            state = stepped(state, q, i, theta, rig)
            out += [(state[2] - q["p1"][i + 1]) / rig["noise"]]
            out += [q["piston"] * (state[3] - q["p2"][i + 1]) / rig["noise"], (state[0] - q["x"][i + 1]) / 5e-5]
        return np.concatenate(out)

    begin = np.log([1.5, 5.0, 30.0, 1e-6, 3e-8, 0.1, 1.0])
    found = np.exp(least_squares(residual, begin, x_scale=0.3, loss="soft_l1", max_nfev=25, diff_step=1e-4).x)
    return named(found, rig)


def named(theta: Array, rig: Mapping[str, float]) -> Fit:
    commands = rig["top"] * np.array(KNOTS[1:])
    areas = theta[3] * np.clip((commands - theta[5]) / (rig["top"] - theta[5]), 0.0, 1.0) ** theta[6]
    return dict(zip(PARAMETERS, map(float, theta[:5]), strict=True)) | {
        "map": as_map(rig["top"], areas, float(theta[5]))
    }


def kalman(data: list[Signals], rig: Mapping[str, float]) -> Fit:
    z = np.log([1.5, 5.0, 30.0, 1e-6, 3e-8, 0.1, 1.0])
    P = np.diag(np.full(7, 0.5**2))
    sizes = np.array([1e-4, 1e-2, 1e3, 1e3, *np.full(7, 1e-3)])  # steps of the differences
    for _ in range(2):
        P = np.diag(np.maximum(np.diag(P), 0.02**2))  # the second pass starts from the first with some doubt
        for s in data:
            there = "x" in s
            v = velocity(s["x"], rig["dt"]) if there else np.zeros(s["u"].size)
            x, p2 = (s["x"], s["p2"]) if there else (np.full(s["u"].size, 0.1), np.full(s["u"].size, rig["ambient"]))
            m = np.concatenate([[x[0], v[0], s["p1"][0], p2[0]], z])
            C = np.zeros((11, 11))
            C[:4, :4], C[4:, 4:] = np.diag([1e-5, 0.02, rig["noise"], rig["noise"]]) ** 2, P
            q = {"u": s["u"], "p_supply": s["p_supply"], "piston": np.array(float(there))}
            drift = np.diag(
                [1e-12, (5.0 * rig["dt"]) ** 2, (2e5 * rig["dt"]) ** 2, (2e5 * rig["dt"]) ** 2, *np.zeros(7)]
            )
            H = np.zeros((3, 11))
            H[[0, 1, 2], [0, 2, 3]] = 1.0
            R = np.diag([2e-6, rig["noise"], rig["noise"]]) ** 2
            read = np.array([x, s["p1"], p2]).T
            for i in range(s["u"].size - 1):
                points = m[:, None] + np.column_stack([np.zeros(11), np.diag(sizes)])
                after = points.copy()
                after[:4] = stepped(points[:4], q, i, np.exp(points[4:]), rig)
                F = (after[:, 1:] - after[:, :1]) / sizes
                m, C = after[:, 0], F @ C @ F.T + drift
                K = np.linalg.solve(H @ C @ H.T + R, H @ C).T
                m = m + K @ (read[i + 1] - H @ m)
                C = (np.eye(11) - K @ H) @ C
                m[4:] = np.clip(m[4:], z - 1.0, z + 1.0)
            z, P = m[4:], C[4:, 4:]
    return named(np.exp(z), rig)


PEERS: dict[str, Callable[[list[Signals], Mapping[str, float]], Fit]] = {
    "pysindy": pysindy,
    "mujoco": mujoco,
    "weak form": weak_form,
    "kalman": kalman,
    "greyest": greyest,
}
SHARED_LINES = {  # what else a user of a peer writes
    "pysindy": (flow, terms, push, velocity),
    "mujoco": (push, velocity),
    "weak form": (flow, terms, push, velocity),
    "kalman": (flow, rates, stepped, velocity),
    "greyest": (flow, rates, stepped, velocity),
}


def written_lines(*functions: Callable[..., Any]) -> int:
    """Return the lines of functions without blanks and docstrings."""
    texts = [inspect.getsource(one).splitlines() for one in functions]
    return sum(bool(line.strip()) and not line.strip().startswith('"""') for text in texts for line in text)


def alone(name: str, folder: Path) -> None:
    """Run one peer on the signals in a folder, where only the peers are installed; print its answer as JSON."""
    rig = json.loads((folder / "rig.json").read_text(encoding="utf-8"))
    with np.load(folder / "signals.npz") as file:
        data = [{k.partition("/")[2]: file[k] for k in file.files if k.startswith(f"{n}/")} for n in rig["names"]]
    warm = [{k: v[:300] for k, v in one.items()} for one in data if "x" in one][:1]
    if name == "pysindy":
        PEERS[name](data, rig)  # imports are no part of its seconds
    elif name == "mujoco":
        PEERS[name](warm, rig)
    start = time.process_time()
    found = PEERS[name](data, rig)
    print(json.dumps({"fit": found, "seconds": time.process_time() - start}, default=float))


# The case, and the judgement by the program.


def prepared(folder: Path, seed: int) -> tuple[dict[str, float], dict[str, Any]]:
    """Write a case, its checked signals and what is known of its rig; return the true parameters and the rig."""
    from pneucli.config import load
    from pneucli.exam.cases import generate_case
    from pneucli.io.artifacts import read_table
    from pneucli.pipeline.graph import Context
    from pneucli.stages import ingest

    truth = generate_case(folder, "axis", ("piston-leak",), "", 1.0, seed)
    (folder / "truth.json").write_text(json.dumps(truth), encoding="utf-8")
    path = folder / "pipeline.toml"
    settings = load(path)
    (folder / "ingest").mkdir()
    ingest.run(Context(path, settings, folder / "ingest", folder))
    table = {k: np.asarray(v) for k, v in read_table(folder / "ingest" / "signals.parquet").items()}
    training = [r.name for r in settings.recordings if r.use == "train"]
    signals = {}
    for name in training:
        mine = table["recording"] == name
        values = {k: np.asarray(v[mine], float) for k, v in table.items() if k != "recording"}
        signals |= {f"{name}/{k}": v for k, v in values.items() if np.isfinite(v).all()}
    np.savez(folder / "signals.npz", **signals)  # type: ignore[arg-type]
    rig, base = settings.to_rig(), truth["base"]
    (area_1, area_2), noise = rig.piston_areas, truth["sensor_noise_pressure_Pa"]
    known = {
        "names": training, "dt": 1e-3, "top": 10.0, "noise": noise, "ambient": rig.ambient_pressure, "A1": area_1,
        "A2": area_2, "V1": rig.dead_volume_1, "V2": rig.dead_volume_2, "stroke": rig.stroke,
        "vessel": rig.vessel_volume,
    }  # fmt: skip
    (folder / "rig.json").write_text(json.dumps(known), encoding="utf-8")
    hidden: Any = truth["hidden"]
    true = {"mass": rig.moving_mass, "coulomb": base["coulomb"], "viscous": base["viscous"]}  # type: ignore[index]
    true |= {"area": base["effective_area_at_10V"], "leak": hidden["piston-leak"]["area"]}  # type: ignore[index]
    return true, known  # type: ignore[return-value]


def of_program(folder: Path) -> tuple[Fit, float, int]:
    """Return what ``identify`` finds without a stated mass, its seconds, and lines of the pipeline file."""
    import tomlkit

    document: Any = tomlkit.parse((folder / "pipeline.toml").read_text(encoding="utf-8"))
    del document["rig"]["cylinder"]["moving_mass"]
    document["model"]["effects"] = ["piston-leak"]
    path = folder / "pneucli.toml"
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
    from benchmarks import cost

    (folder / "measured").mkdir()
    measured = cost.measure(path, ["ingest", "identify"], folder / "measured")
    seconds = sum(one.seconds - one.phases.get("imports", 0.0) for one in measured.values())
    answer = json.loads((folder / "measured" / "identify" / "stage.json").read_text(encoding="utf-8"))["answer"]
    values = {name: entry["value"] for name, entry in answer["model"]["parameters"].items()}
    areas = {float(n.partition("(")[2].removesuffix(" V)")): v for n, v in values.items() if "effective_area(" in n}
    commands = sorted(u for u in areas if u > 0.0)
    sizes = [0.5 * (areas[u] + areas.get(-u, areas[u])) for u in commands]
    names = {"mass": "rig.moving_mass", "coulomb": "friction.coulomb", "viscous": "friction.viscous"}
    fit = {k: values[v] for k, v in names.items()} | {"area": sizes[-1], "leak": values["piston-leak.area"]}
    kinds = {(t["experiment"], t["use"]) for t in document["recordings"]}
    head = tomlkit.dumps({k: v for k, v in document.items() if k not in ("recordings", "compare")})
    lines = [line for line in head.splitlines() if line.strip() and not line.startswith("#")]
    return fit | {"map": (commands, sizes, values["valve.overlap_fill"])}, seconds, len(lines) + 4 * len(kinds)


def judged_by(folder: Path, true: Fit) -> Callable[[Fit], list[float]]:
    """Return a function of a fit: its held-out errors times noise, of motion and of pressures; noise by the truth."""
    import tomlkit

    from benchmarks.rigs import study_of
    from pneucli.compare import compare, overall_error
    from pneucli.compare.expected_error import expected_errors

    judges = []
    for experiment, kept in (("friction", "axis"), ("valve", "valve")):
        case = folder / f"judge-{experiment}"
        (case / "out").mkdir(parents=True)
        (case / "raw").symlink_to(folder / "raw")
        document: Any = tomlkit.parse((folder / "pipeline.toml").read_text(encoding="utf-8"))
        recordings = tomlkit.aot()
        for table in document["recordings"]:
            if table["experiment"] == kept:  # the noise of a sensor is that of all of its recordings
                table["experiment"] = experiment
                recordings.append(table)
        document["recordings"] = recordings
        (case / "pipeline.toml").write_text(tomlkit.dumps(document), encoding="utf-8")
        study = study_of(case, case / "out")
        held = [e for e in study.experiments if e.recording.use == "test"]
        judges.append((study.rig, held, [one.rms for one in expected_errors(model_of(study.rig, true), held)]))

    def errors(fit: Fit) -> list[float]:
        found = []
        for rig, held, noise in judges:
            model = model_of(rig, fit)
            results = [r for e, rms in zip(held, noise, strict=True) for r in compare(model, e, rms).results]
            found.append(float(overall_error(results, "test") or np.nan))
        return found if "map" in fit else [found[0], np.nan]

    return errors


def model_of(rig: Any, fit: Fit) -> Any:
    """Return the program's model with the parameters of a fit."""
    from dataclasses import replace

    from pneucli.simulate.model import Model
    from pneucli.simulate.valve_forms import ValveArea

    commands, areas, overlap = fit.get("map", ([10.0], [1e-6], 0.0))
    opened = [(u, a) for u, a in zip(commands, areas, strict=True) if u > overlap]
    both = [*((-u, a) for u, a in reversed(opened)), *opened]
    valve = ValveArea(tuple(u for u, _ in both), tuple(max(a, 1e-12) for _, a in both), overlap, overlap)
    values = {"friction.coulomb": fit["coulomb"], "friction.viscous": fit["viscous"]}
    values["rig.vessel_volume"] = rig.vessel_volume
    return Model(replace(rig, moving_mass=fit["mass"]), (), values, valve)


def environment(folder: Path) -> Path:
    """Install the peers into a virtual environment; return its Python."""
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, *PINNED], check=True)
    return python


def answers(folder: Path, python: Path) -> Iterator[tuple[str, Fit, float, int]]:
    """Yield name, fit, seconds and lines of each peer."""
    for name, peer in PEERS.items():
        words = [str(python), "-W", "ignore", __file__, "--alone", name, str(folder)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{name}: {done.stderr.strip()[-300:]}", file=sys.stderr)
            continue
        found = json.loads(done.stdout.splitlines()[-1])
        yield name, found["fit"], found["seconds"], written_lines(peer, *SHARED_LINES[name])
    yield ("pneucli", *of_program(folder))


def cells(true: Mapping[str, float], fit: Fit) -> list[str]:
    """Return the error of each parameter in per cent."""
    return [f"{100.0 * (fit[name] / true[name] - 1.0):+.2f}" if name in fit else "–" for name in PARAMETERS]


def print_small() -> None:
    """Fit the first samples of each recording with the peers that need numpy and scipy alone."""
    with tempfile.TemporaryDirectory() as place:
        true, rig = prepared(Path(place), 1)
        with np.load(Path(place) / "signals.npz") as file:
            names = [n for n in rig["names"] if not n.startswith("step")]
            data = [{k.partition("/")[2]: file[k][:450] for k in file.files if k.startswith(f"{n}/")} for n in names]
    for name in ("weak form", "kalman"):
        print(f"| {name} | {' | '.join(cells(true, PEERS[name](data, rig)))} |")


def main(arguments: list[str]) -> None:
    """Print a row for each peer and rig, and the median size of its errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--small", action="store_true")
    parser.add_argument("--alone", nargs=2, metavar=("PEER", "FOLDER"), help="used within the virtual environment")
    asked = parser.parse_args(arguments)
    if asked.alone:
        alone(asked.alone[0], Path(asked.alone[1]))
        return
    columns = [f"{name}, %" for name in PARAMETERS]
    print(f"| rig | peer | {' | '.join(columns)} | motion, × noise | pressures, × noise | s | lines |")
    print(f"|{' --- |' * (len(columns) + 6)}")
    if asked.small:
        print_small()
        return
    with tempfile.TemporaryDirectory() as place:
        python = environment(Path(place) / "venv")
        for seed in range(1, 1 + asked.seeds):
            folder = Path(place) / f"rig-{seed}"
            true, _ = prepared(folder, seed)
            exact: Fit = true | {"map": true_map(folder)}
            errors = judged_by(folder, exact)
            for name, fit, seconds, lines in (*answers(folder, python), ("truth", exact, 0.0, 0)):
                shown = [*cells(true, fit), *(f"{one:.2f}" for one in errors(fit))]
                print(f"| {seed} | {name} | {' | '.join(shown)} | {seconds:.1f} | {lines} |", flush=True)


def true_map(folder: Path) -> tuple[list[float], list[float], float]:
    """Return the true map of a case, from what was sealed of it."""
    base = json.loads((folder / "truth.json").read_text(encoding="utf-8"))["base"]
    commands = np.array([0.5, 1.0, 2.0, 3.5, 5.0, 7.5, 10.0])
    openings = np.clip((commands - base["overlap_V"]) / (10.0 - base["overlap_V"]), 0.0, 1.0) ** base["area_exponent"]
    return commands.tolist(), (base["effective_area_at_10V"] * openings).tolist(), base["overlap_V"]


if __name__ == "__main__":
    main(sys.argv[1:])
