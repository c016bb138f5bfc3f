#!/bin/sh
# nixio 1.5.4: what is read in bar is written as counts: 6.5 put back into its own array is 0.006 afterwards.
#
# An array of int16 counts with polynomial coefficients (0, 0.001) and the unit bar. Reading, by slice, `read_direct` or
# numpy, gives bar. Writing takes raw counts: `p[1] = p[1]`, a reading put back, changes 6.5 to 0.006, as its whole part
# is stored; `append` of 6.5 does the same. Neither scales back, refuses nor warns, and the help names the polynomial for
# reading only. A tag over 0 to 2 ms has 2 of 3 samples, its end is left out unless `SliceMode.Inclusive`. Write counts,
# or store floats without coefficients.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile nixio==1.5.4 packaging==26.4 numpy==2.4.6 h5py==3.16.0
v/bin/python -W ignore - <<'END' | tee seen
import nixio
import numpy as np

file = nixio.File.open("p.nix", nixio.FileMode.Overwrite)
block = file.create_block("run", "recording")
p = block.create_data_array("p", "pressure", data=np.array([6000, 6500, 7000], "int16"), unit="bar")
p.polynom_coefficients = (0.0, 0.001)
p.append_sampled_dimension(0.001, unit="s")
print("as stored:  ", p[:])
tag = block.create_tag("step", "range", [0.0])
tag.extent, tag.units = [0.002], ["s"]
tag.references.append(p)
print("tag of 2 ms:", tag.tagged_data(0)[:], "inclusive", tag.tagged_data(0, stop_rule=nixio.SliceMode.Inclusive)[:])
p[1] = p[1]
print("put back:   ", p[:])
p.append(np.array([6.5]))
print("appended:   ", p[:])
END
diff - seen <<'END'
as stored:   [6.  6.5 7. ]
tag of 2 ms: [6.  6.5] inclusive [6.  6.5 7. ]
put back:    [6.e+00 6.e-03 7.e+00]
appended:    [6.e+00 6.e-03 7.e+00 6.e-03]
END
