#!/bin/sh
# Cantera 3.2.0: air through a `Valve` from 7 to 1 bar is six times what passes from 7 to 6 bar, as it never chokes.
#
# The flow of a `Valve` is K times the difference of pressure, whatever the gas. Air through a real valve (ISO 6358, b =
# 0.3) chokes at 2.1 of 7 bar, and passes 1.65 times what it passes into 6 bar. So a K that is fitted on a nearly full
# vessel fills an empty one 3.6 times too fast, and one fitted on an empty vessel is as much too slow at the end. Nor
# does it flow back: from a lower to a higher pressure the flow is 0, as through a check valve. No message in either
# case. `pressure_function` is given the difference alone; compute the flow, and set it by a MassFlowController.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile cantera==3.2.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import cantera

air = {name: cantera.Solution("air.yaml") for name in ("before", "after")}


def flow(before, after):
    """The mass flow in g/s through a valve of K = 1e-8 kg/(s Pa), pressures in bar."""
    for name, pressure in (("before", before), ("after", after)):
        air[name].TP = 293.15, pressure * 1e5
    vessel = cantera.IdealGasReactor(air["after"], volume=1e3)
    valve = cantera.Valve(cantera.Reservoir(air["before"]), vessel, K=1e-8)
    network = cantera.ReactorNet([vessel])
    network.step()
    return valve.mass_flow_rate * 1e3


def of_iso_6358(before, after, b=0.3):
    ratio = after / before
    return before * (1 if ratio <= b else (1 - ((ratio - b) / (1 - b)) ** 2) ** 0.5)


full, should = flow(7, 6), of_iso_6358(7, 6)
for after in (6, 5, 4, 3, 2.1, 1):
    print(f"from 7 to {after:3g} bar: {flow(7, after):.2f} g/s, {flow(7, after) / full:.2f} of that to 6 bar;", end=" ")
    print(f"by ISO 6358 {of_iso_6358(7, after) / should:.2f}")
print(f"from 1 to   7 bar: {flow(1, 7):.2f} g/s")
END
diff - seen <<'END'
from 7 to   6 bar: 1.00 g/s, 1.00 of that to 6 bar; by ISO 6358 1.00
from 7 to   5 bar: 2.00 g/s, 2.00 of that to 6 bar; by ISO 6358 1.33
from 7 to   4 bar: 3.00 g/s, 3.00 of that to 6 bar; by ISO 6358 1.52
from 7 to   3 bar: 4.00 g/s, 4.00 of that to 6 bar; by ISO 6358 1.62
from 7 to 2.1 bar: 4.90 g/s, 4.90 of that to 6 bar; by ISO 6358 1.65
from 7 to   1 bar: 6.00 g/s, 6.00 of that to 6 bar; by ISO 6358 1.65
from 1 to   7 bar: 0.00 g/s
END
