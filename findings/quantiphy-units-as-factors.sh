#!/bin/sh
# QuantiPhy 2.23: 6 Pa is 6e15, 7 psi is 7e-12 and 20 min is 0.02, as the first letter of a unit is a scale factor.
#
# Texts as a data sheet or a form has them, taken by `Quantity(text)`, which is a float. bar, kPa, l/min and degC are
# right; Pa, psi, min, ft, Torr, atm, cfm and rpm lose their first letter to peta, pico, milli, femto, tera, atto, centi
# and ronto. 300 K is 300000, and 5 m is 0.005. Even 5 kg is 5000, of g. Nothing warns, and the unit printed beside ("a",
# "si", "in") is all that shows. The manual speaks of the ambiguity in general, and `known_units` mends it for units that
# somebody names: 100 rpm, not named, stays wrong.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile quantiphy==2.23
v/bin/python -W ignore - <<'END' | tee seen
from quantiphy import Quantity

texts = "6 bar|600 kPa|60 l/min|20 degC|6 Pa|7 psi|20 min|5 ft|2 Torr|1 atm|5 cfm|100 rpm|300 K|5 m|5 kg".split("|")
plain = [Quantity(text) for text in texts]
Quantity.set_prefs(known_units="Pa psi min ft Torr atm cfm K m")
for text, found in zip(texts, plain):
    named = Quantity(text)
    print(f"{text:9s} {found.real:8.3g} of {found.units!r:10s} after known_units: {named.real:8.3g} of {named.units!r}")
END
diff - seen <<'END'
6 bar            6 of 'bar'      after known_units:        6 of 'bar'
600 kPa      6e+05 of 'Pa'       after known_units:    6e+05 of 'Pa'
60 l/min        60 of 'l/min'    after known_units:       60 of 'l/min'
20 degC         20 of 'degC'     after known_units:       20 of 'degC'
6 Pa         6e+15 of 'a'        after known_units:        6 of 'Pa'
7 psi        7e-12 of 'si'       after known_units:        7 of 'psi'
20 min        0.02 of 'in'       after known_units:       20 of 'min'
5 ft         5e-15 of 't'        after known_units:        5 of 'ft'
2 Torr       2e+12 of 'orr'      after known_units:        2 of 'Torr'
1 atm        1e-18 of 'tm'       after known_units:        1 of 'atm'
5 cfm         0.05 of 'fm'       after known_units:        5 of 'cfm'
100 rpm      1e-25 of 'pm'       after known_units:    1e-25 of 'pm'
300 K        3e+05 of ''         after known_units:      300 of 'K'
5 m          0.005 of ''         after known_units:        5 of 'm'
5 kg         5e+03 of 'g'        after known_units:    5e+03 of 'g'
END
