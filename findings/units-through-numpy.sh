#!/bin/sh
# unyt 3.2.0, astropy 8.0.2, pint 0.25.3: functions of NumPy and SciPy that take readings with units, and numbers that come back with wrong ones.
#
# A gap in a pressure of 1 bar, filled by `nan_to_num` with 50 kPa: in unyt the whole array is in kPa afterwards, so that 1 bar has become
# 1 kPa. `unwrap` of 0 and 350 degrees is -1.86 degrees, as it counts in radians; `round` makes bar dimensionless. pint and astropy are
# right in all three. SciPy takes units off in all: of a pressure over seconds, asked at 15 ms, its interpolator returns a value for 15 s, -20 000 bar,
# without a word in unyt and astropy, with a warning in pint. Savitzky-Golay filters return plain numbers alike.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile unyt==3.2.0 astropy==8.0.2 pint==0.25.3 scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import warnings

import astropy.units
import numpy as np
import pint
import unyt
from scipy.interpolate import PchipInterpolator
from scipy.signal import savgol_filter

registry = pint.UnitRegistry()
LIBRARIES = {
    "pint": lambda values, unit: registry.Quantity(np.asarray(values, float), unit),
    "unyt": lambda values, unit: unyt.unyt_array(np.asarray(values, float), unit),
    "astropy": lambda values, unit: np.asarray(values, float) * astropy.units.Unit(unit),
}
times = np.arange(10.0) * 0.01
CALLS = {
    "nan_to_num, 50 kPa": lambda made: np.nan_to_num(made([1, np.nan], "bar"), nan=made(50, "kPa")),
    "unwrap of 0, 350 deg": lambda made: np.unwrap(made([0, 350], "deg")),
    "round of 1.26 bar": lambda made: np.round(made([1.26], "bar"), 1),
    "savgol_filter of bar": lambda made: savgol_filter(made(times, "bar"), 5, 2)[:1],
    "pchip over s, at 15 ms": lambda made: PchipInterpolator(made(times, "s"), made(times**2, "bar"))(made([15], "ms")),
}
for what, call in CALLS.items():
    for library, made in LIBRARIES.items():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = call(made)
        unit = str(getattr(result, "units", getattr(result, "unit", "no unit")))
        numbers = getattr(result, "magnitude", getattr(result, "value", result))
        print(f"{what}, {library}:", *(f"{value:.3g}" for value in numbers.tolist()), unit + (", warns" if caught else ""))
END
diff - seen <<'END'
nan_to_num, 50 kPa, pint: 1 0.5 bar
nan_to_num, 50 kPa, unyt: 1 50 kPa
nan_to_num, 50 kPa, astropy: 1 0.5 bar
unwrap of 0, 350 deg, pint: 0 -10 degree
unwrap of 0, 350 deg, unyt: 0 -1.86 degree
unwrap of 0, 350 deg, astropy: 0 -10 deg
round of 1.26 bar, pint: 1.3 bar
round of 1.26 bar, unyt: 1.3 dimensionless
round of 1.26 bar, astropy: 1.3 bar
savgol_filter of bar, pint: 0 no unit, warns
savgol_filter of bar, unyt: 0 no unit
savgol_filter of bar, astropy: 0 no unit
pchip over s, at 15 ms, pint: -2.05e+04 no unit, warns
pchip over s, at 15 ms, unyt: -2.05e+04 no unit
pchip over s, at 15 ms, astropy: -2.05e+04 no unit
END
