#!/bin/sh
# auto-control-tools 0.0.1: 3 s sampled at 10 Hz are 30 s by Ziegler and Nichols; a falling step has no gain.
#
# A first-order plant, gain 2, 3 s, dead time 1.5 s, without noise. The steepest slope is taken per sample, and its
# tangent drawn over seconds: at 1 Hz all is near, at 10 Hz the time constant is 10 times too long, at 100 Hz 100
# times, and the dead time 0.6 s and 0.5 s. The method of Hagglund shares the tangent for its dead time. The others are
# right within 10 % from 10 Hz on. Readings below zero are made zero before any method: a step that falls from rest has
# a gain of 0 in silence, or is refused for a negative time. Take Smith's, and turn a falling step over.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile auto-control-tools==0.0.1 control==0.9.4 pandas==2.1.2 numpy==1.26.4
v/bin/python -W ignore - <<'END' | tee seen
import auto_control_tools as act
import numpy as np
import pandas as pd

methods = {
    "Ziegler and Nichols": act.ZieglerNicholsModelIdentification,
    "Hagglund": act.HagglundModelIdentification,
    "Smith": act.SmithModelIdentification,
    "Sundaresan and Krishnaswamy": act.SundaresanKrishnaswamyModelIdentification,
    "Nishikawa": act.NishikawaModelIdentification,
}
for gain in (2, -2):
    for rate in (1, 10, 100) if gain > 0 else (10,):
        times = np.arange(40 * rate) / rate
        answer = gain * np.where(times > 1.5, 1 - np.exp(-(times - 1.5) / 3), 0)
        pd.DataFrame({"time": times, "output": answer}).to_csv("step.csv", index=False)
        for name, method in methods.items():
            try:
                model = method.get_model("step.csv", sample_time=1 / rate, step_signal=1.0)
                found = f"gain {model.K:.3g}, time constant {model.tau:.3g} s, dead time {model.theta:.3g} s"
            except ValueError as error:
                found = f"ValueError, {error}"
            print(f"gain {gain}, {rate} Hz, {name}: {found}")
END
diff - seen <<'END'
gain 2, 1 Hz, Ziegler and Nichols: gain 1.99, time constant 2.53 s, dead time 2 s
gain 2, 1 Hz, Hagglund: gain 1.99, time constant 3 s, dead time 2 s
gain 2, 1 Hz, Smith: gain 1.99, time constant 3 s, dead time 2 s
gain 2, 1 Hz, Sundaresan and Krishnaswamy: gain 1.99, time constant 3.35 s, dead time 1.58 s
gain 2, 1 Hz, Nishikawa: gain 1.99, time constant 2.26 s, dead time 2.14 s
gain 2, 10 Hz, Ziegler and Nichols: gain 1.99, time constant 30.4 s, dead time 0.6 s
gain 2, 10 Hz, Hagglund: gain 1.99, time constant 3.9 s, dead time 0.6 s
gain 2, 10 Hz, Smith: gain 1.99, time constant 3 s, dead time 1.5 s
gain 2, 10 Hz, Sundaresan and Krishnaswamy: gain 1.99, time constant 2.95 s, dead time 1.65 s
gain 2, 10 Hz, Nishikawa: gain 1.99, time constant 2.84 s, dead time 1.58 s
gain 2, 100 Hz, Ziegler and Nichols: gain 2, time constant 300 s, dead time 0.51 s
gain 2, 100 Hz, Hagglund: gain 2, time constant 3.98 s, dead time 0.51 s
gain 2, 100 Hz, Smith: gain 2, time constant 2.99 s, dead time 1.5 s
gain 2, 100 Hz, Sundaresan and Krishnaswamy: gain 2, time constant 2.95 s, dead time 1.56 s
gain 2, 100 Hz, Nishikawa: gain 2, time constant 2.85 s, dead time 1.56 s
gain -2, 10 Hz, Ziegler and Nichols: ValueError, require T >= 0
gain -2, 10 Hz, Hagglund: ValueError, require T >= 0
gain -2, 10 Hz, Smith: gain 0, time constant 0 s, dead time 0 s
gain -2, 10 Hz, Sundaresan and Krishnaswamy: gain 0, time constant 0 s, dead time 0 s
gain -2, 10 Hz, Nishikawa: ValueError, require T >= 0
END
