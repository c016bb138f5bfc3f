#!/bin/sh
# tm-data-types 0.5.0 (Tektronix): a CSV with exact numbers is read as 16-bit counts, a spike coarsens the rest, and a peak is read as the lowest.
#
# A pressure that leaks from 1.2 bar in steps of 0.1 mbar, as WFM, CSV and MAT. The CSV holds eight decimals. `read_file` turns the numbers of
# CSV and MAT into integers that span from the lowest to the highest of them. Here the highest, 1.2 bar, comes out as the
# lowest, 1.1981 bar: by rounding its count is one too many for 16 bits, and wraps. With one spike of 100 bar in the
# recording (a loose plug), the counts are 1.5 mbar apart, and of twenty readings three are left. WFM keeps the floats.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile tm-data-types==0.5.0 numpy==1.26.4 pandas==3.0.6
v/bin/python -W ignore - <<'END' | tee seen
import csv

import numpy as np
from tm_data_types import AnalogWaveform, read_file, write_file

leak = np.round(1.2 - 1e-4 * np.arange(20), 4)
spike = leak.copy()
spike[3] = 100.0
for what, p1 in (("leak", leak), ("leak with a spike", spike)):
    wave = AnalogWaveform()
    wave.y_axis_values, wave.y_axis_units, wave.source_name = p1.copy(), "bar", "CH1"
    wave.x_axis_spacing, wave.trigger_index = 1e-3, 0.0
    for kind in ("wfm", "csv", "mat"):
        write_file(f"rig.{kind}", wave)
        read = read_file(f"rig.{kind}").normalized_vertical_values
        print(f"{what}, {kind}: different readings {len(np.unique(read))} of 20, the first three", *(f"{p:.4f}" for p in read[:3]))
    with open("rig.csv", newline="") as file:
        rows = list(csv.reader(file))[-20:]
    print(f"{what}, the text of the CSV:", *(f"{float(row[1]):.4f}" for row in rows[:3]))
END
diff - seen <<'END'
leak, wfm: different readings 20 of 20, the first three 1.2000 1.1999 1.1998
leak, csv: different readings 20 of 20, the first three 1.1981 1.1999 1.1998
leak, mat: different readings 20 of 20, the first three 1.1981 1.1999 1.1998
leak, the text of the CSV: 1.2000 1.1999 1.1998
leak with a spike, wfm: different readings 20 of 20, the first three 1.2000 1.1999 1.1998
leak with a spike, csv: different readings 3 of 20, the first three 1.2004 1.2004 1.2004
leak with a spike, mat: different readings 3 of 20, the first three 1.2004 1.2004 1.2004
leak with a spike, the text of the CSV: 1.2000 1.1999 1.1998
END
