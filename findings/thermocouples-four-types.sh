#!/bin/sh
# thermocouples 2.1.2: 16.748 mV of a type N are 542 degC, not 500; 51.877 mV of a type J are -881, not 900; B and S are off by millivolts.
#
# A thermocouple's reference functions are polynomials, each for a part of the range. thermocouple-its90 1.0.2 has those of NIST,
# and gives back what its tables say. In `thermocouples` parts of four types go wrong, in one direction or in both: N below 0 degC,
# and its voltages around 400 degC; the voltages of J above 760; the temperatures of B from 700 on, whose voltage is ten times too large
# and more, and of S at 1200. K agrees. Nothing raises or warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile thermocouples==2.1.2 thermocouple-its90==1.0.2
v/bin/python -W ignore - <<'END' | tee seen
import thermocouple_its90
import thermocouples

for letter, hot in (("K", 500.0), ("N", -100.0), ("N", 20.0), ("N", 500.0), ("J", 300.0), ("J", 900.0), ("B", 1200.0), ("S", 1200.0)):
    other, right = thermocouples.get_thermocouple(letter), thermocouple_its90.get(letter)
    volts = right.emf(hot)
    found = f"{other.temp_to_volt(hot) * 1e3:.3f} mV and {other.volt_to_temp(volts / 1e3):.1f} degC"
    print(f"{letter} {hot:g} degC: by the tables {volts:.3f} mV and {right.temperature(volts):.1f} degC, by thermocouples {found}")
END
diff - seen <<'END'
K 500 degC: by the tables 20.644 mV and 500.0 degC, by thermocouples 20.644 mV and 500.0 degC
N -100 degC: by the tables -2.407 mV and -100.0 degC, by thermocouples -1.844 mV and -84.9 degC
N 20 degC: by the tables 0.525 mV and 20.0 degC, by thermocouples 0.525 mV and 20.0 degC
N 500 degC: by the tables 16.748 mV and 500.0 degC, by thermocouples 16.748 mV and 542.1 degC
J 300 degC: by the tables 16.327 mV and 300.0 degC, by thermocouples 16.327 mV and 300.0 degC
J 900 degC: by the tables 51.877 mV and 900.0 degC, by thermocouples 51.877 mV and -880.6 degC
B 1200 degC: by the tables 6.786 mV and 1200.0 degC, by thermocouples 94.956 mV and 1200.0 degC
S 1200 degC: by the tables 11.951 mV and 1200.0 degC, by thermocouples -11.019 mV and 1200.0 degC
END
