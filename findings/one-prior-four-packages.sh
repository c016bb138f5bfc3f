#!/bin/sh
# OpenTURNS 1.27, chaospy 4.3.21, mcerp 1.1.1, SciPy 1.17.1: Gamma(2, 3) has a mean of 0.67, 6, 6 or 5; Uniform(5, 7) of 6 or 8.5.
#
# One study, written down once and run with another package. The second number of Gamma is a rate in OpenTURNS, a scale
# in chaospy and mcerp, a shift in SciPy. LogNormal(1.8, 0.1), a pressure of 6 bar within 10 %, is that in OpenTURNS and
# chaospy; in mcerp it is 1.8, in SciPy 5.2 with a deviation of 25. A waiting time Exponential(2) is 0.5 in OpenTURNS
# and mcerp, 2 in chaospy, 3 in SciPy; Laplace(6, 0.5) is four times as wide in OpenTURNS. A tolerance Uniform(5, 7)
# goes to 12 in SciPy. Normal alone is the same in all. None complains. Draw a sample and look at its mean before a
# study is compared.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile openturns==1.27.post1 chaospy==4.3.21 mcerp==1.1.1 scipy==1.17.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import chaospy
import mcerp
import numpy as np
import openturns
from scipy import stats

shares = (np.arange(100_000) + 0.5) / 100_000


def said(made):
    if isinstance(made, chaospy.Distribution):
        drawn = np.ravel(made.inv(shares))
        mean, deviation = drawn.mean(), drawn.std()
    elif isinstance(made, openturns.DistributionImplementation):
        mean, deviation = made.getMean()[0], made.getStandardDeviation()[0]
    elif isinstance(made, mcerp.UncertainFunction):
        mean, deviation = made.mean, made.std
    else:
        mean, deviation = made.mean(), made.std()
    return f"{mean:.2g} +- {deviation:.1g}"


for what, values, names in (
    ("Normal", (6, 0.5), ("Normal", "Normal", "N", "norm")),
    ("Uniform", (5, 7), ("Uniform", "Uniform", "U", "uniform")),
    ("Gamma", (2, 3), ("Gamma", "Gamma", "Gamma", "gamma")),
    ("LogNormal", (1.8, 0.1), ("LogNormal", "LogNormal", "LogN", "lognorm")),
    ("Exponential", (2,), ("Exponential", "Exponential", "Exp", "expon")),
    ("Laplace", (6, 0.5), ("Laplace", "Laplace", None, "laplace")),
):
    packages = zip(("OpenTURNS", "chaospy", "mcerp", "SciPy"), (openturns, chaospy, mcerp, stats), names)
    found = [f"{package} {said(getattr(module, name)(*values))}" for package, module, name in packages if name]
    print(f"{what}{values}:", ", ".join(found))
END
diff - seen <<'END'
Normal(6, 0.5): OpenTURNS 6 +- 0.5, chaospy 6 +- 0.5, mcerp 6 +- 0.5, SciPy 6 +- 0.5
Uniform(5, 7): OpenTURNS 6 +- 0.6, chaospy 6 +- 0.6, mcerp 6 +- 0.6, SciPy 8.5 +- 2
Gamma(2, 3): OpenTURNS 0.67 +- 0.5, chaospy 6 +- 4, mcerp 6 +- 4, SciPy 5 +- 1
LogNormal(1.8, 0.1): OpenTURNS 6.1 +- 0.6, chaospy 6.1 +- 0.6, mcerp 1.8 +- 0.2, SciPy 5.2 +- 3e+01
Exponential(2,): OpenTURNS 0.5 +- 0.5, chaospy 2 +- 2, mcerp 0.5 +- 0.5, SciPy 3 +- 1
Laplace(6, 0.5): OpenTURNS 6 +- 3, chaospy 6 +- 0.7, SciPy 6 +- 0.7
END
