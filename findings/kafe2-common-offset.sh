#!/bin/sh
# kafe2 2.11.0: fifty readings that share the error of their sensor have a mean of 1 +- 0 bar; they are all near 6.
#
# A constant fitted to readings with 0.1 bar of uncertainty, fully correlated, as the zero of a sensor is. Their
# covariance has no inverse, and the fit stays where it began, at 1, with an error of 0 and `did_fit` true; NumPy
# mutters of a logarithm. A correlation of 0.999999 gives 6.01 +- 0.1, and so does an independent part, however small:
# then all is right. State the noise besides the common error, or ask for `goodness_of_fit`, which is NaN.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile kafe2==2.11.0 numpy==2.4.6 scipy==1.17.1 matplotlib==3.11.2
v/bin/python -W ignore - <<'END' | tee seen
import kafe2
import numpy as np

volts = np.linspace(0, 10, 50)
pressure = 6 + np.random.default_rng(0).normal(0, 0.1, 50)


def constant(x, level=1.0):
    return level + 0 * x


for errors in ([(0.1, 1.0)], [(0.1, 0.999999)], [(0.1, 1.0), (0.001, 0.0)], [(0.1, 1.0), (0.1, 0.0)], [(0.1, 0.0)]):
    data = kafe2.XYContainer(volts, pressure)
    for size, correlation in errors:
        data.add_error("y", size, correlation=correlation)
    fit = kafe2.Fit(data, constant)
    result = fit.do_fit()
    stated = " and ".join(f"{size} bar correlated by {correlation}" for size, correlation in errors)
    print(f"{stated}: {fit.parameter_values[0]:.4g} +- {fit.parameter_errors[0]:.2g}", end=", ")
    print(f"did_fit {result['did_fit']}, goodness {result['goodness_of_fit']:.3g}")
END
diff - seen <<'END'
0.1 bar correlated by 1.0: 1 +- 0, did_fit True, goodness nan
0.1 bar correlated by 0.999999: 6.013 +- 0.1, did_fit True, goodness 4.15e+07
0.1 bar correlated by 1.0 and 0.001 bar correlated by 0.0: 6.013 +- 0.1, did_fit True, goodness 4.15e+05
0.1 bar correlated by 1.0 and 0.1 bar correlated by 0.0: 6.013 +- 0.1, did_fit True, goodness 41.5
0.1 bar correlated by 0.0: 6.013 +- 0.014, did_fit True, goodness 41.5
END
