#!/bin/sh
# cantools 45.1.0: one DBC, and a controller in C sends 0.2 bar where Python sends 0.3.
#
# (Needs a C compiler, cc.) A signal of 16 bits with a factor of 0.1 and a range of -100 to 100 bar. `encode_message`
# rounds: 0.3 is 3 counts. The C made by `generate_c_source` cuts: 2 counts, as 0.3 / 0.1 is a hair below 3; so it goes
# with 67 of the 200 set-points from 0.1 to 20.0. A reference that one program sends and another compares is off by a
# count. `--use-round` mends it; it is no default, and the file that is made does not say how it was made.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile cantools==45.1.0
v/bin/python -W ignore - <<'END' | tee seen
import subprocess
from pathlib import Path

import cantools

Path("axis.dbc").write_text('VERSION ""\nNS_ :\nBS_:\nBU_: A\nBO_ 1 Ref: 2 A\n SG_ P : 0|16@1- (0.1,0) [-100|100] "bar" A\n')
Path("main.c").write_text("""#include <stdio.h>
#include "axis.h"
int main(void) {
    double value;
    while (scanf("%lf", &value) == 1) {
        int16_t counts = axis_ref_p_encode(value);
        printf("%d %g\\n", counts, axis_ref_p_decode(counts));
    }
}
""")
database = cantools.database.load_file("axis.dbc")


def sent_by_c(values, *options):
    make = ["v/bin/python", "-m", "cantools", "generate_c_source", "axis.dbc", *options]
    subprocess.run(make, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cc", "main.c", "axis.c", "-lm", "-o", "main"], check=True)
    text = "\n".join(map(repr, values))
    return [line.split() for line in subprocess.run("./main", input=text, capture_output=True, text=True).stdout.splitlines()]


def sent_by_python(value):
    return int.from_bytes(database.encode_message("Ref", {"P": value}), "little", signed=True)


values = (0.3, 1.2, 2.3, 6.5)
for value, (counts, decoded) in zip(values, sent_by_c(values)):
    print(f"{value:6g} bar: Python {sent_by_python(value)}; C {counts}, which is {decoded} bar")
points = [count / 10 for count in range(1, 201)]
for options in ((), ("--use-round",)):
    low = sum(int(found[0]) < sent_by_python(point) for point, found in zip(points, sent_by_c(points, *options)))
    print(f"C {' '.join(options)}: {low} of {len(points)} set-points one count low")
END
diff - seen <<'END'
   0.3 bar: Python 3; C 2, which is 0.2 bar
   1.2 bar: Python 12; C 11, which is 1.1 bar
   2.3 bar: Python 23; C 22, which is 2.2 bar
   6.5 bar: Python 65; C 65, which is 6.5 bar
C : 67 of 200 set-points one count low
C --use-round: 0 of 200 set-points one count low
END
