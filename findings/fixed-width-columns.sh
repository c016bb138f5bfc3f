#!/bin/sh
# pandas 3.0.6, astropy 8.0.2: a log of fixed width loses signs and digits that come later than its first hundred rows.
#
# `read_fwf` takes for columns what a hundred rows fill. A command that falls from 5 to -5 V at row 150 stays 5: its
# sign stands where no column is. A pressure that passes 99.99 kPa goes on at 0.00; flush left it loses its last
# digit. astropy's "fixed_width" takes what stands below the letters of the heading: of 5.00 V the last 0. No error or
# warning. Reading by blanks, `sep=r"\s+"`, or `infer_nrows` of the whole log is right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandas==3.0.6 astropy==8.0.2 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import io
import warnings

import pandas as pd
from astropy.io import ascii

warnings.simplefilter("error")
logs = {
    "command": [f"{k:6d}{5.0 if k < 150 else -5.0:8.2f}" for k in range(300)],
    "pressure": [f"{k:6d}{99.0 + 0.01 * k:8.2f}" for k in range(300)],
    "pressure, flush left": [f"{k:6d} {99.0 + 0.01 * k:<8.2f}" for k in range(300)],
}
for what, rows in logs.items():
    text = "\n".join(["   row" + ("  y" if "left" in what else "       y"), *rows])
    at = (149, 150) if what == "command" else (99, 101)
    blanks = pd.read_csv(io.StringIO(text), sep=r"\s+")["y"]
    narrow, whole = (pd.read_fwf(io.StringIO(text), **keys).iloc[:, -1] for keys in ({}, {"infer_nrows": 300}))
    for reader, y in (("blanks", blanks), ("read_fwf", narrow), ("read_fwf, infer_nrows=300", whole)):
        print(f"{what}, {reader}:", *(f"{y[n]:.2f}" for n in at))
table = ascii.read("\n".join(["   row       y", *logs["command"]]), format="fixed_width", delimiter=" ")
print("command, astropy fixed_width:", *(table["y"][n] for n in (149, 150)))
END
diff - seen <<'END'
command, blanks: 5.00 -5.00
command, read_fwf: 5.00 5.00
command, read_fwf, infer_nrows=300: 5.00 -5.00
pressure, blanks: 99.99 100.01
pressure, read_fwf: 99.99 0.01
pressure, read_fwf, infer_nrows=300: 99.99 100.01
pressure, flush left, blanks: 99.99 100.01
pressure, flush left, read_fwf: 99.99 100.00
pressure, flush left, read_fwf, infer_nrows=300: 99.99 100.01
command, astropy fixed_width: 0 0
END
