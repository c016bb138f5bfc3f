#!/bin/sh
# fluids 1.3.1: air that expands from 10 bar to 1 bar with an efficiency of 0.7 leaves at 93 K, colder than without any loss.
#
# `isentropic_T_rise_compression` is for a fluid that is "compressed or expanded", says its help, and divides by the
# efficiency in both. For a compressor that is right. An air motor or an exhaust with 0.7 would cool air of 300 K to 199
# K, ideal is 155 K, and the function says 93 K. `isentropic_work_compression` gives, for the same expansion, 6.0 kJ/mol
# of work, of which an ideal one has 4.2 and a real one 2.9. No efficiency can have this; nothing raises. Use the ideal
# result, and multiply by the efficiency yourself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile fluids==1.3.1 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
from fluids import isentropic_T_rise_compression as temperature
from fluids import isentropic_work_compression as work

for what, start, end in (("compressed", 1e5, 1e6), ("expanded", 1e6, 1e5)):
    ideal, found = (temperature(T1=300, P1=start, P2=end, k=1.4, eta=eta) for eta in (1, 0.7))
    ideal_work, found_work = (work(T1=300, P1=start, P2=end, k=1.4, eta=eta) / 1e3 for eta in (1, 0.7))
    factor = 1 / 0.7 if end > start else 0.7
    print(f"{what:10s} ideal {ideal:.0f} K and {ideal_work:.2f} kJ/mol, by energy {300 + (ideal - 300) * factor:.0f} K and"
          f" {ideal_work * factor:.2f} kJ/mol, found {found:.0f} K and {found_work:.2f} kJ/mol")  # fmt: skip
END
diff - seen <<'END'
compressed ideal 579 K and 8.13 kJ/mol, by energy 699 K and 11.61 kJ/mol, found 699 K and 11.61 kJ/mol
expanded   ideal 155 K and -4.21 kJ/mol, by energy 199 K and -2.95 kJ/mol, found 93 K and -6.01 kJ/mol
END
