#!/bin/sh
# pandas 3.1.1 (`sep=None`, by `csv.Sniffer` of Python): the decimal comma of a recording without names parts its columns.
#
# A recording without names that has semicolons between columns and decimal commas in them, as German Excel writes it,
# is cut at the commas: stamps lose their hundredths, and the whole of each pressure stands in one column with them as
# text. With names above it the same rows are cut right. Python's Sniffer decides so for pandas' `sep=None`; CleverCSV
# is right with both. Nothing warns.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandas==3.1.1 numpy==2.4.6 clevercsv==0.8.5
v/bin/python -W ignore - <<'END' | tee seen
import csv
import io

import clevercsv
import pandas as pd

rows = "".join(f"{n / 100:.2f};{1 + n / 7:.3f}\n".replace(".", ",") for n in range(60))
for what, text in (("without names", rows), ("with names", "t;p1\n" + rows)):
    header = None if what == "without names" else 0
    frame = pd.read_csv(io.StringIO(text), sep=None, engine="python", header=header)
    print(f"{what}: csv {csv.Sniffer().sniff(text).delimiter}  clevercsv {clevercsv.Sniffer().sniff(text).delimiter}  "
          f"pandas {frame.shape[1]} columns: {' | '.join(map(str, frame.iloc[1]))}")
END
diff - seen <<'END'
without names: csv ,  clevercsv ;  pandas 3 columns: 0 | 01;1 | 143
with names: csv ;  clevercsv ;  pandas 2 columns: 0,01 | 1,143
END
