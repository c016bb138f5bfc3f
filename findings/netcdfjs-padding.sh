#!/bin/sh
# netcdfjs 4.0.0: between the readings of a channel of 16 bits stands -32767, and three bytes are four.
#
# netCDF 3 fills up each variable to a multiple of four bytes. netcdfjs hands over the filling as data: a valve command
# stored as short beside a pressure has a second value, -32767, in each record, so that a flattened channel has twice as
# many samples and a mean near -16384; a table of three bytes has a fourth value of 129, which is -127 without its sign.
# A file with a single record variable, which has no filling, is right. scale_factor is not applied. Nothing warns. Take
# the first value of each record, as many as the dimension says.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . netcdfjs@4.0.0
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END'
from scipy.io import netcdf_file

for name in ("two", "one"):
    with netcdf_file(f"{name}.nc", "w") as file:
        file.createDimension("time", None)
        command = file.createVariable("u", "i2", ("time",))
        command.scale_factor = 0.001
        if name == "two":
            pressure = file.createVariable("p", "f8", ("time",))
            file.createDimension("valve", 3)
            file.createVariable("state", "i1", ("valve",))[:] = [1, 2, 3]
        for sample, counts in enumerate((-5000, 0, 5000)):
            command[sample] = counts
            if name == "two":
                pressure[sample] = 6.25
    with netcdf_file(f"{name}.nc", mmap=False) as file:
        print(f"{name}.nc, SciPy:", {key: value[:].tolist() for key, value in file.variables.items()})
END
cat >run.mjs <<'END'
import { readFileSync } from "fs";
import { NetCDFReader } from "netcdfjs";

for (const name of ["two.nc", "one.nc"]) {
  const file = new NetCDFReader(readFileSync(name));
  for (const { name: key } of file.variables) {
    console.log(`${name}, ${key}:`, JSON.stringify(file.getDataVariable(key)));
  }
}
END
node run.mjs | tee seen
diff - seen <<'END'
two.nc, state: [[1],[2],[3],[129]]
two.nc, u: [[-5000,-32767],[0,-32767],[5000,-32767]]
two.nc, p: [6.25,6.25,6.25]
one.nc, u: [-5000,0,5000]
END
