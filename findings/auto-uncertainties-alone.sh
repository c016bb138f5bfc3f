#!/bin/sh
# auto_uncertainties 1.1.0: a pressure less itself is 0 +- 0.14 bar, and p * p is surer than p ** 2.
#
# Each result forgets what it was made of, so that every operation takes its operands for independent: 6.0 +- 0.1 less
# itself, over itself, or plus itself has an error of its own, and p * p has 0.85 where p ** 2 has 1.2, which is right.
# The same ratio written in two ways, (p + d) / p and 1 + d / p, differs tenfold in its error. The package uncertainties
# keeps the origin. Nothing says so at run time. Write each formula so that each reading stands in it once, or take
# uncertainties.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile auto_uncertainties==1.1.0 uncertainties==3.2.3 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
from auto_uncertainties import Uncertainty
from uncertainties import ufloat


def shown(found):
    if isinstance(found, Uncertainty):
        return f"{found.value:.4g} +- {found.error:.4f}"
    return f"{getattr(found, 'nominal_value', found):.4g} +- {getattr(found, 'std_dev', 0):.4f}"


formulas = {
    "p - p": lambda p, d: p - p,
    "p / p": lambda p, d: p / p,
    "p + p": lambda p, d: p + p,
    "2 * p": lambda p, d: 2 * p,
    "p * p": lambda p, d: p * p,
    "p ** 2": lambda p, d: p**2,
    "(p + d) / p": lambda p, d: (p + d) / p,
    "1 + d / p": lambda p, d: 1 + d / p,
}
for text, formula in formulas.items():
    alone, kept = (shown(formula(make(6.0, 0.1), make(0.5, 0.01))) for make in (Uncertainty, ufloat))
    print(f"{text:12s} auto_uncertainties {alone:18s} uncertainties {kept}")
END
diff - seen <<'END'
p - p        auto_uncertainties 0 +- 0.1414        uncertainties 0 +- 0.0000
p / p        auto_uncertainties 1 +- 0.0236        uncertainties 1 +- 0.0000
p + p        auto_uncertainties 12 +- 0.1414       uncertainties 12 +- 0.2000
2 * p        auto_uncertainties 12 +- 0.2000       uncertainties 12 +- 0.2000
p * p        auto_uncertainties 36 +- 0.8485       uncertainties 36 +- 1.2000
p ** 2       auto_uncertainties 36 +- 1.2000       uncertainties 36 +- 1.2000
(p + d) / p  auto_uncertainties 1.083 +- 0.0246    uncertainties 1.083 +- 0.0022
1 + d / p    auto_uncertainties 1.083 +- 0.0022    uncertainties 1.083 +- 0.0022
END
