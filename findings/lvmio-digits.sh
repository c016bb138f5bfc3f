#!/bin/sh
# lvmio 1.0.0, lvm_read 1.26: a position of 0.12 mm has three digits, one of 0.099 mm seven, and 3 kHz are 3003 Hz.
#
# lvmio writes numbers as LabVIEW does: six decimals from 0.0001 on, seven digits with an exponent below. So a
# position in metres is kept to 1 um where it is large, and a voltage of a bridge keeps three digits. Delta_X has six
# decimals as well: who makes a clock of it, at 3 kHz, is 0.1 % fast; X_Value does not drift. Log in mm and mV.
# pneucli takes X_Value. What the other layouts of lvmio showed was mended: where each channel has an X_Value of its
# own, pneucli put all on that of the first one, and a comment hid the names.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile lvmio==1.0.0 lvm_read==1.26 numpy==2.3.5
v/bin/python -W ignore - <<'END' | tee seen
import lvm_read
import lvmio
from lvmio import Channel, LvmFile, Segment

position = [0.0000987654, 0.000123456, 0.0123456, 0.123456]
lvmio.write_lvm("rig.lvm", LvmFile([Segment([Channel("x", position, "m", 0.0, 1 / 3000)])]))
read = lvm_read.read("rig.lvm")[0]
print("written:", *position)
print("read:   ", *(f"{value:.10g}" for value in read["data"][:, 1]))
print(f"rate: {1 / read['Delta_X'][0]:.1f} Hz by Delta_X, {3 / read['data'][3, 0]:.1f} Hz by X_Value")
END
diff - seen <<'END'
written: 9.87654e-05 0.000123456 0.0123456 0.123456
read:    9.87654e-05 0.000123 0.012346 0.123456
rate: 3003.0 Hz by Delta_X, 3000.0 Hz by X_Value
END
