#!/bin/sh
# python-dateutil 4.0.0: in one log with points in its dates the 12th is the 11th month, and the next day is right.
#
# A date that may be read with the month first is, whatever stands between its numbers: 12.11.2026 is December, 11.
# 13.11.2026 cannot be, and is the 13th of November. Each text is judged by itself, so that a log that passes from the
# 12th to the 13th goes back by four weeks, and one that ends on the 12th is a month away, in order. Nothing warns.
# `dayfirst=True` mends that, and reads the ISO date 2026-11-12 as the 11th of December.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile python-dateutil==4.0.0
v/bin/python -W ignore - <<'END' | tee seen
from datetime import timedelta

from dateutil import parser

log = ["11.11.2026 23:59:59", "12.11.2026 23:59:59", "13.11.2026 00:00:01", "2026-11-12 23:59:59"]
for text in log:
    print(f"{text}  {parser.parse(text):%d %B}  dayfirst {parser.parse(text, dayfirst=True):%d %B}")
gap = parser.parse(log[2]) - parser.parse(log[1])
print("two seconds over midnight are", gap // timedelta(seconds=1), "s")
END
diff - seen <<'END'
11.11.2026 23:59:59  11 November  dayfirst 11 November
12.11.2026 23:59:59  11 December  dayfirst 12 November
13.11.2026 00:00:01  13 November  dayfirst 13 November
2026-11-12 23:59:59  12 November  dayfirst 11 December
two seconds over midnight are -2505598 s
END
