#!/bin/sh
# canopen 2.4.1: a default of -200 in a drive's EDS is read as 65336, beside limits that are read with their sign.
#
# An object of INTEGER16 states DefaultValue=0xFF38 (-200), LowLimit=0x8000 and HighLimit=0x7FFF, as editors write them.
# The limits become -32768 and 32767, the default 65336, outside of them. Stated as -200 it is -200. The same for INTEGER8
# and INTEGER32. So an offset of a position or a pressure that is compared with the device's, or restored from the EDS, is
# 65536 too large; `od[...].raw` of a device is right.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile canopen==2.4.1
v/bin/python -W ignore - <<'END' | tee seen
import canopen

TEXT = """[DeviceInfo]
[MandatoryObjects]
SupportedObjects=0
[OptionalObjects]
SupportedObjects=0
[ManufacturerObjects]
SupportedObjects=4
1=0x2000
2=0x2001
3=0x2002
4=0x2003
"""
OBJECTS = ((3, "0xFF38", 4), (3, "-200", 4), (2, "0x9C", 2), (4, "0xFFFFFF38", 8))
for index, (kind, default, digits) in enumerate(OBJECTS):
    TEXT += f"[{0x2000 + index:X}]\nParameterName=Offset {index}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\n"
    TEXT += f"DefaultValue={default}\nLowLimit=0x8{'0' * (digits - 1)}\nHighLimit=0x7{'F' * (digits - 1)}\nPDOMapping=0\n"
with open("drive.eds", "w") as file:
    file.write(TEXT)
found = canopen.import_od("drive.eds")
for index, (kind, default, digits) in enumerate(OBJECTS):
    one = found[0x2000 + index]
    name = {2: "INTEGER8", 3: "INTEGER16", 4: "INTEGER32"}[kind]
    print(f"{name}, {default}: default {one.default}, between {one.min} and {one.max}")
END
diff - seen <<'END'
INTEGER16, 0xFF38: default 65336, between -32768 and 32767
INTEGER16, -200: default -200, between -32768 and 32767
INTEGER8, 0x9C: default 156, between -128 and 127
INTEGER32, 0xFFFFFF38: default 4294967096, between -2147483648 and 2147483647
END
