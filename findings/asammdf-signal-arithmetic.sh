#!/bin/sh
# asammdf 8.8.28: arithmetic on signals chooses a clock of its own and keeps a unit that is wrong.
#
# The sum of a pressure (0 to 0.4 s) and a signal on other stamps (0.15 to 0.35 s) stands neither on the stamps of the
# first nor on those of the second: it has all stamps of both that lie in the common interval. Floats are interpolated
# there, integers keep the value before. The unit is the first operand's whatever is computed: bar + mbar adds the
# numbers, and a square, a quotient and a comparison are in bar.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
from asammdf import Signal

p1 = Signal(np.array([1.0, 2, 3, 4, 5]), np.arange(5) * 0.1, unit="bar", name="p1")
u = Signal(np.array([10, 20, 30], "int16"), np.array([0.15, 0.25, 0.35]), unit="V", name="u")


def show(what, signal):
    print(f"{what:9s}", *(f"{value:g}" for value in signal.samples), signal.unit)


total = p1 + u
show("p1 + u", total)
print("stamps   ", *(f"{stamp:g}" for stamp in total.timestamps))
show("p1 + mbar", p1 + Signal(p1.samples * 100, p1.timestamps, unit="mbar", name="p2"))
show("p1 ** 2", p1**2)
show("p1 / p1", p1 / p1)
show("p1 > 2", p1 > 2)
END
diff - seen <<'END'
p1 + u    12.5 13 23.5 24 34.5 bar
stamps    0.15 0.2 0.25 0.3 0.35
p1 + mbar 101 202 303 404 505 bar
p1 ** 2   1 4 9 16 25 bar
p1 / p1   1 1 1 1 1 bar
p1 > 2    0 0 1 1 1 bar
END
