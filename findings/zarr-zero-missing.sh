#!/bin/sh
# zarr 3.1.6 and xarray 2026.9.0: a valve command of 0 V written by the one is a missing reading in the other.
#
# A Zarr array of format 2 has a fill value, 0 unless another is stated. For zarr it is what stands in chunks that were
# never written; xarray takes it for the mark of a missing reading, so that each 0 in the recording is NaN, in floats
# and in whole numbers alike: the closed valve, the position at the home stop, the rest. Neither warns. In format 3,
# zarr's default, the zeros stay. State `fill_value=numpy.nan` (None for whole numbers) in format 2, or open with
# `mask_and_scale=False`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile zarr==3.1.6 numcodecs==0.16.6 xarray==2026.9.0 pandas==3.1.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import xarray
import zarr

command = np.array([0.0, 5.0, 0.0, -5.0])
for form in (2, 3):
    for name, data, keys in (
        ("floats", command, {}),
        ("whole numbers", command.astype("i2"), {}),
        ("floats, fill NaN", command, {"fill_value": np.nan}),
        ("whole numbers, fill None", command.astype("i2"), {"fill_value": None}),
    ):
        if form == 3:
            if keys:
                continue
            keys["dimension_names"] = ["time"]
        path = f"{name} {form}.zarr"
        group = zarr.open_group(path, mode="w", zarr_format=form)
        array = group.create_array("u", shape=data.shape, dtype=data.dtype, **keys)
        if form == 2:
            array.attrs["_ARRAY_DIMENSIONS"] = ["time"]
        array[:] = data
        found = xarray.open_zarr(path, consolidated=False)["u"].values
        bare = xarray.open_zarr(path, consolidated=False, mask_and_scale=False)["u"].values
        print(f"format {form}, {name}: zarr", *array[:], "| xarray", *found, "| unmasked", *bare)
END
diff - seen <<'END'
format 2, floats: zarr 0.0 5.0 0.0 -5.0 | xarray nan 5.0 nan -5.0 | unmasked 0.0 5.0 0.0 -5.0
format 2, whole numbers: zarr 0 5 0 -5 | xarray nan 5.0 nan -5.0 | unmasked 0 5 0 -5
format 2, floats, fill NaN: zarr 0.0 5.0 0.0 -5.0 | xarray 0.0 5.0 0.0 -5.0 | unmasked 0.0 5.0 0.0 -5.0
format 2, whole numbers, fill None: zarr 0 5 0 -5 | xarray 0 5 0 -5 | unmasked 0 5 0 -5
format 3, floats: zarr 0.0 5.0 0.0 -5.0 | xarray 0.0 5.0 0.0 -5.0 | unmasked 0.0 5.0 0.0 -5.0
format 3, whole numbers: zarr 0 5 0 -5 | xarray 0 5 0 -5 | unmasked 0 5 0 -5
END
