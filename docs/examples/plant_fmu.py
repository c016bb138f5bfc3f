"""Run the exported plant in FMPy: steps of the command from rest, another load, another mass.

python plant_fmu.py pneucli_plant.fmu
"""

import sys

import fmpy
import numpy as np

STEP = 1e-3  # s, between the calls of the FMU


def run(path: str, **start_values: float) -> np.ndarray:
    """Return the outputs of two seconds: the valve opens by 1 V, shuts, opens the other way, shuts."""
    described = {v.name: v for v in fmpy.read_model_description(path).modelVariables}
    null = float(described["u"].start)
    time = np.arange(0.0, 2.0, STEP)
    u = null + np.select([time < 0.2, time < 0.6, time < 1.0, time < 1.4], [0.0, 1.0, 0.0, -1.0], 0.0)
    start = {v.name: float(v.start) for v in described.values() if v.causality == "input"}
    columns = {"time": time} | {name: np.full(time.size, value) for name, value in start.items()} | {"u": u}
    inputs = np.rec.fromarrays(list(columns.values()), names=list(columns))
    return fmpy.simulate_fmu(
        path,
        stop_time=time[-1],
        step_size=STEP,
        output_interval=STEP,
        input=inputs,
        start_values=start_values,
        output=["x", "v", "p1", "p2"],
    )


def main() -> None:
    """Print where the piston ends, as identified and with 5 kg more."""
    path = sys.argv[1]
    mass = next(v for v in fmpy.read_model_description(path).modelVariables if v.name == "rig.moving_mass")
    print(f"{mass.name} = {mass.start} {mass.unit} ({mass.description})")
    for more in (0.0, 5.0):
        result = run(path, **{"rig.moving_mass": float(mass.start) + more})
        print(
            f"with {more:g} kg more: x ends at {1e3 * result['x'][-1]:.3f} mm, p1 at {1e-5 * result['p1'][-1]:.3f} bar"
        )


if __name__ == "__main__":
    main()
