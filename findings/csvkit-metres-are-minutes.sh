#!/bin/sh
# csvkit 2.2.0, agate 1.14.2: a stroke of "0.2 m" is 12 seconds, and a share of 6 % is 6.
#
# A table of axes with units in its cells. What all rows of a column can be decides: "0.2 m" is two tenths of a minute,
# so that `csvjson` writes 0:00:12; a height of "2 h" is two hours. "200 mm", "20 l/min" and "20 ms" stay texts; "5 s"
# is five seconds. "6%" and "6 %" lose their sign, and are not a hundredth of it. One cell that is no time, "0.2 mm",
# makes the column text again. Nothing is said. Keep the unit in the heading, or state `--no-inference`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile csvkit==2.2.0 agate==1.14.2
v/bin/python -W ignore - <<'END' | tee seen
import subprocess

columns = {
    "stroke in m": ("0.2 m", "0.25 m"),
    "stroke in mm": ("200 mm", "250 mm"),
    "m and mm": ("0.2 m", "250 mm"),
    "height": ("2 h", "3 h"),
    "dead time": ("20 ms", "30 ms"),
    "delay": ("5 s", "6 s"),
    "leak": ("6%", "7 %"),
    "flow": ("20 l/min", "30 l/min"),
}
for name, cells in columns.items():
    with open("axes.csv", "w") as file:
        file.write("\n".join(("value", *cells)) + "\n")
    for options in ((), ("--no-inference",)) if name == "stroke in m" else ((),):
        answer = subprocess.run(["v/bin/csvjson", *options, "axes.csv"], capture_output=True, text=True, check=True)
        print(name, *options, answer.stdout.strip())
END
diff - seen <<'END'
stroke in m [{"value": "0:00:12"}, {"value": "0:00:15"}]
stroke in m --no-inference [{"value": "0.2 m"}, {"value": "0.25 m"}]
stroke in mm [{"value": "200 mm"}, {"value": "250 mm"}]
m and mm [{"value": "0.2 m"}, {"value": "250 mm"}]
height [{"value": "2:00:00"}, {"value": "3:00:00"}]
dead time [{"value": "20 ms"}, {"value": "30 ms"}]
delay [{"value": "0:00:05"}, {"value": "0:00:06"}]
leak [{"value": 6.0}, {"value": 7.0}]
flow [{"value": "20 l/min"}, {"value": "30 l/min"}]
END
