#!/bin/sh
# minimalmodbus 2.1.1: a set-point is cut, not rounded, to the register's decimals: 0.29 bar is sent as 28 hundredths.
#
# `write_register(0, 0.29, 2)` is to send 29. The value is multiplied and its whole part is sent, so that every binary
# number a hair below its decimals loses one count: 69 of the 1000 set-points from 0.01 to 10.00, among them 0.29, 0.57,
# 1.13 and 4.35. A value that a controller computes is half a count too low on average. The help says that 77.0 with one
# decimal is sent as 770, and nothing of the rest. `round(value * 100)` sent without decimals is right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile minimalmodbus==2.1.1 pyserial==3.5
v/bin/python -W ignore - <<'END' | tee seen
import minimalmodbus
import serial


class Line:
    """A serial line whose device answers each request to write with the same bytes, as Modbus wants."""

    port, baudrate, timeout, is_open = "line", 19200, 0.05, True

    def __init__(self, *_, **__):
        self.sent = b""

    def write(self, data):
        self.sent = data

    def read(self, _):
        return self.sent

    def open(self):
        pass

    close = reset_input_buffer = reset_output_buffer = open


serial.Serial = Line
device = minimalmodbus.Instrument("line", 1)


def sent(value, decimals):
    device.write_register(0, value, decimals, functioncode=6)
    return int.from_bytes(device.serial.sent[4:6], "big")


for value in (0.29, 0.57, 1.13, 4.35, 6.00):
    print(f"{value:.2f} bar is sent as {sent(value, 2)}")
points = range(1, 1001)
print("one count low:", sum(sent(point / 100, 2) == point - 1 for point in points), "of", len(points))
print("otherwise wrong:", sum(sent(point / 100, 2) not in (point - 1, point) for point in points))
print(f"5.999 bar is sent as {sent(5.999, 2)}, and rounded before as {sent(round(5.999 * 100), 0)}")
END
diff - seen <<'END'
0.29 bar is sent as 28
0.57 bar is sent as 56
1.13 bar is sent as 112
4.35 bar is sent as 434
6.00 bar is sent as 600
one count low: 69 of 1000
otherwise wrong: 0
5.999 bar is sent as 599, and rounded before as 600
END
