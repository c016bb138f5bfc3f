#!/bin/sh
# pandas 3.0.6: JSON has ten decimals, so a sonic conductance in SI units keeps two digits, and a small leak is 0.
#
# C = 5.123e-9 m3/(s Pa) is 5.1e-9 after `to_json`, 0.4 % off; a leak of 3.3e-11 kg/s is 0. What is counted is
# decimals, not digits; 15, the most that may be asked for, keep all digits here. polars writes all digits.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandas==3.0.6 polars==2.1.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import json

import pandas as pd
import polars as pl

values = {"C": 5.123e-9, "area": 4.909e-4, "leak": 3.3e-11}
frame = pd.DataFrame([values])
for what, text in (
    ("pandas", frame.to_json(orient="records")),
    ("pandas, double_precision=15", frame.to_json(orient="records", double_precision=15)),
    ("polars", pl.DataFrame([values]).write_json()),
):
    print(f"{what}:", json.loads(text)[0])
END
diff - seen <<'END'
pandas: {'C': 5.1e-09, 'area': 0.0004909, 'leak': 0.0}
pandas, double_precision=15: {'C': 5.123e-09, 'area': 0.0004909, 'leak': 3.3e-11}
polars: {'C': 5.123e-09, 'area': 0.0004909, 'leak': 3.3e-11}
END
