#!/bin/sh
# MicroPython 1.27.0 (npm): a sensor's -200 is 65336, a command of 300 is 44, and 6.25 bar is shown as 6.3 for Python's 6.2.
#
# `int.from_bytes(data, "little", True)` takes no notice of its third argument and gives counts without sign;
# `signed=True`, as Python has it, raises. Numbers that do not fit are cut in `array` and `struct.pack`, where Python
# raises: a valve command of 300 in a byte is 44, 40000 in a short -25536. Halves are rounded up in texts, and
# `round(0.35, 1)` is 0.4 for 0.3, so that a log of a microcontroller and one of Python differ in the last digit. A
# missing reading in JSON is `nan`, which JSON's readers refuse (Python writes `NaN`). Use `struct.unpack`, and check
# ranges yourself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . @micropython/micropython-webassembly-pyscript@1.27.0
cat >lines.json <<'END'
["int.from_bytes(b'\\x38\\xff', 'little')",
 "int.from_bytes(b'\\x38\\xff', 'little', True)",
 "struct.unpack('<h', b'\\x38\\xff')[0]",
 "array.array('B', [300])[0]",
 "struct.unpack('<h', struct.pack('<h', 40000))[0]",
 "(-200).to_bytes(2, 'little')",
 "'%.1f' % 6.25",
 "'%.2f' % 0.125",
 "round(0.35, 1)",
 "json.dumps(float('nan'))"]
END
cat >run.mjs <<'END'
import { readFileSync } from "fs";
import { loadMicroPython } from "@micropython/micropython-webassembly-pyscript/micropython.mjs";

const python = await loadMicroPython({ stdout: (line) => console.log(line), linebuffer: true });
python.runPython("import array, json, struct");
for (const line of JSON.parse(readFileSync("lines.json"))) python.runPython(`print(${JSON.stringify(line)}, "->", ${line})`);
END
cat >run.py <<'END'
import array
import json
import struct

for line in json.load(open("lines.json")):
    try:
        print(line, "->", eval(line))
    except Exception as error:
        print(line, "->", type(error).__name__)
END
{
    echo MicroPython
    node run.mjs
    echo Python
    python3 run.py
} | tee seen
diff - seen <<'END'
MicroPython
int.from_bytes(b'\x38\xff', 'little') -> 65336
int.from_bytes(b'\x38\xff', 'little', True) -> 65336
struct.unpack('<h', b'\x38\xff')[0] -> -200
array.array('B', [300])[0] -> 44
struct.unpack('<h', struct.pack('<h', 40000))[0] -> -25536
(-200).to_bytes(2, 'little') -> b'8\xff'
'%.1f' % 6.25 -> 6.3
'%.2f' % 0.125 -> 0.13
round(0.35, 1) -> 0.4
json.dumps(float('nan')) -> nan
Python
int.from_bytes(b'\x38\xff', 'little') -> 65336
int.from_bytes(b'\x38\xff', 'little', True) -> TypeError
struct.unpack('<h', b'\x38\xff')[0] -> -200
array.array('B', [300])[0] -> OverflowError
struct.unpack('<h', struct.pack('<h', 40000))[0] -> error
(-200).to_bytes(2, 'little') -> OverflowError
'%.1f' % 6.25 -> 6.2
'%.2f' % 0.125 -> 0.12
round(0.35, 1) -> 0.3
json.dumps(float('nan')) -> NaN
END
