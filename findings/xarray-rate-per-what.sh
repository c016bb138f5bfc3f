#!/bin/sh
# xarray 2026.9.0: a leak of 0.5 bar/s is 0.5, 0.0005 or 5e-10, by the unit in which the stamps happen to be stored.
#
# The same stamps and pressures, stamps stored in s, ms, us and ns, as files and pandas 3 hand them over. `differentiate`,
# `integrate` and `curvefit` count in the unit of storage: the slope is 0.5 to 5e-10, the integral 2500 to 2.5e12.
# `polyfit` counts in ns always. The unit stands in the dtype alone, and no result names it. `differentiate(...,
# datetime_unit="s")` and `integrate` with it are right for all; the other two have no such argument: subtract the first
# stamp and make seconds of it before.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile xarray==2026.9.0 pandas==3.1.1 numpy==2.4.6 scipy==1.17.1
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import xarray as xr

seconds = np.arange(0, 101, 10)
for unit in ("s", "ms", "us", "ns"):
    stamps = np.datetime64("2026-01-01", unit) + seconds.astype("m8[s]").astype(f"m8[{unit}]")
    p = xr.DataArray(0.5 * seconds, dims="time", coords={"time": stamps})
    fit = p.curvefit("time", lambda t, slope, start: slope * t + start).curvefit_coefficients
    print(f"{unit:2s}", f"differentiate {float(p.differentiate('time')[5]):.3g}", f"curvefit {float(fit[0]):.3g}",
          f"polyfit {float(p.polyfit('time', 1).polyfit_coefficients[0]):.3g}", f"integrate {float(p.integrate('time')):.3g}",
          f"stated in s: {float(p.differentiate('time', datetime_unit='s')[5]):.3g},",
          f"{float(p.integrate('time', datetime_unit='s')):.5g}", sep="  ")  # fmt: skip
END
diff - seen <<'END'
s   differentiate 0.5  curvefit 0.5  polyfit 5e-10  integrate 2.5e+03  stated in s: 0.5,  2500
ms  differentiate 0.0005  curvefit 0.0005  polyfit 5e-10  integrate 2.5e+06  stated in s: 0.5,  2500
us  differentiate 5e-07  curvefit 5e-07  polyfit 5e-10  integrate 2.5e+09  stated in s: 0.5,  2500
ns  differentiate 5e-10  curvefit 5e-10  polyfit 5e-10  integrate 2.5e+12  stated in s: 0.5,  2500
END
