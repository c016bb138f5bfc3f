#!/bin/sh
# asammdf 8.8.28 and mf4-rs 3.7.0: one MDF4 file, two conversions, two readings.
#
# A conversion to text names the states 0 and 1 of a channel; the samples are 0, 1, 7. asammdf reads 7 as an empty text,
# so that the number is lost; mf4-rs gives 7. With a default conversion (2 x) for all other numbers, asammdf gives 14
# and makes the two named states NaN; mf4-rs keeps their names. The formula 0.25*X**2 of the numbers 2, 4, 8 is
# evaluated by asammdf (1, 4, 16); mf4-rs returns 2, 4, 8 without a word.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile asammdf==8.8.28 mf4-rs==3.7.0 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
import mf4_rs
import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.conversion_utils import from_dict

states = {"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on"}
double = from_dict({"a": 2.0, "b": 0.0})
cases = {
    "states": ([0, 1, 7], states),
    "with default": ([0, 1, 7], {**states, "default_addr": double}),
    "formula": ([2, 4, 8], {"formula": "0.25*X**2"}),
}
for name, (counts, conversion) in cases.items():
    path = f"{name}.mf4"
    file = MDF(version="4.10")
    values = np.array(counts, "uint8")
    file.append([Signal(values, np.arange(3) * 0.1, name="x", conversion=from_dict(conversion))])
    file.save(path)
    print(f"{name:13s} asammdf", *MDF(path).get("x").samples.tolist(), "| mf4-rs", *mf4_rs.Mdf(path).read("x").tolist())
END
diff - seen <<'END'
states        asammdf b'off' b'on' b'' | mf4-rs off on 7
with default  asammdf nan nan 14.0 | mf4-rs off on 14.0
formula       asammdf 1.0 4.0 16.0 | mf4-rs 2.0 4.0 8.0
END
