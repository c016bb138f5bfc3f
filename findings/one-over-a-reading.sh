#!/bin/sh
# error-propagation 0.0.4 and measurement-stats 0.3.0: 1/p of a pressure of 6.0 +- 0.1 bar is 6.0 +- 0.1, and 5 - p is +1.
#
# A number on the left of a reading is taken as if it stood on the right. In error-propagation 5 - p is p - 5, so that a
# difference has the other sign. In both 1/p is p/1: a compliance, a time constant V/(R T C) or a period of a frequency is the
# reading itself. 5 - p is right in measurement-stats. uncertainties 3.2.3 is right in each. Nothing raises.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile error-propagation==0.0.4 measurement-stats==0.3.0 uncertainties==3.2.3 numpy==2.4.6 pandas==3.1.1
v/bin/python -W ignore - <<'END' | tee seen
from error_propagation import Complex
from measurement_stats import ValueUncertainty
from uncertainties import ufloat

for name, make in (("uncertainties", ufloat), ("error-propagation", Complex), ("measurement-stats", ValueUncertainty)):
    p = make(6.0, 0.1)
    for text, one in (("p - 5", p - 5), ("5 - p", 5 - p), ("p / 2", p / 2), ("1 / p", 1 / p), ("2 / p", 2 / p)):
        value = getattr(one, "nominal_value", getattr(one, "value", None))
        print(f"{name}: {text} = {value:.3g}")
END
diff - seen <<'END'
uncertainties: p - 5 = 1
uncertainties: 5 - p = -1
uncertainties: p / 2 = 3
uncertainties: 1 / p = 0.167
uncertainties: 2 / p = 0.333
error-propagation: p - 5 = 1
error-propagation: 5 - p = 1
error-propagation: p / 2 = 3
error-propagation: 1 / p = 6
error-propagation: 2 / p = 3
measurement-stats: p - 5 = 1
measurement-stats: 5 - p = -1
measurement-stats: p / 2 = 3
measurement-stats: 1 / p = 6
measurement-stats: 2 / p = 3
END
