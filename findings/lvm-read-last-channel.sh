#!/bin/sh
# lvm_read 1.26: of a LabVIEW file with a clock for each channel the last ones are lost, and stamps are readings.
#
# With "X_Columns Multi" LabVIEW writes stamps in front of each channel: two channels are four columns. The reader takes
# as many columns as channels and one clock, three, so that the second channel is its stamps and its readings are gone.
# The names that it gives say so (`X_Value` twice), and nothing warns. Files with one clock, or none, are right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile lvm_read==1.26 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import lvm_read

KEYS = {"LabVIEW Measurement": "", "Writer_Version": "2", "Reader_Version": "2", "Separator": "Tab", "Time_Pref": "Relative"}


def read(columns, table):
    keys = KEYS | {"Decimal_Separator": ".", "Multi_Headings": "No", "X_Columns": columns, "***End_of_Header***": ""}
    keys |= {"": "", "Channels": "2\t", "Samples": "3\t3\t", "X0": "0\t0\t", "Delta_X": "0.01\t0.02\t"}
    head = [f"{key}\t{value}" for key, value in keys.items()] + ["***End_of_Header***\t\t"]
    with open("run.lvm", "w") as file:
        file.write("\n".join([*head, *table]) + "\n")
    found = lvm_read.read("run.lvm", read_from_pickle=False, dump_file=False)[0]
    print(columns, *found["Channel names"])
    for row in found["data"]:
        print(*(f"{value:g}" for value in row))


read("One", ["X_Value\tp1\tp2\tComment", "0\t1.0\t2.0", "0.01\t1.1\t2.2", "0.02\t1.2\t2.4"])
read("Multi", ["X_Value\tp1\tX_Value\tp2\tComment", "0\t1.0\t0\t2.0", "0.01\t1.1\t0.02\t2.2", "0.02\t1.2\t0.04\t2.4"])
END
diff - seen <<'END'
One X_Value p1 p2
0 1 2
0.01 1.1 2.2
0.02 1.2 2.4
Multi X_Value p1 X_Value
0 1 0
0.01 1.1 0.02
0.02 1.2 0.04
END
