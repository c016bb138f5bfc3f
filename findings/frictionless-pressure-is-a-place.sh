#!/bin/sh
# frictionless 5.21.0: a pressure of 6,25 bar is a place on earth, 6 degrees east and 25 north.
#
# A log with semicolons and decimal commas. The separator is found, and each reading is then taken for two numbers: the
# column is a `geopoint`, its cells lists of two, in `describe`, `extract` and `read_rows`; the file is valid. With one
# digit, 6,5 is 6 east and 5 north. Beyond 180 it is a text: a pressure in hundreds of kPa is one, one in bar a place.
# Nothing warns. State `field_candidates`, or a schema with `decimalChar: ","`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile frictionless==5.21.0
v/bin/python -W ignore - <<'END' | tee seen
from frictionless import Resource, Schema, validate

logs = {"bar": "p;u\n6,25;5\n6,5;5\n", "kPa": "p;u\n625,0;5\n650,5;5\n", "points": "p;u\n6.25;5\n6.5;5\n"}
for name, text in logs.items():
    with open("log.csv", "w") as file:
        file.write(text)
    with Resource("log.csv") as log:
        types = {field.name: field.type for field in log.schema.fields}
        print(f"{name}: {types},", [str(row["p"]) for row in log.read_rows()], end=" ")
    print("valid" if validate("log.csv").valid else "not valid")
fields = [{"name": "p", "type": "number", "decimalChar": ","}, {"name": "u", "type": "integer"}]
with open("log.csv", "w") as file:
    file.write(logs["bar"])
with Resource("log.csv", schema=Schema.from_descriptor({"fields": fields})) as log:
    print("with a schema:", [float(row["p"]) for row in log.read_rows()])
END
diff - seen <<'END'
bar: {'p': 'geopoint', 'u': 'integer'}, ['[6.0, 25.0]', '[6.0, 5.0]'] valid
kPa: {'p': 'string', 'u': 'integer'}, ['625,0', '650,5'] valid
points: {'p': 'number', 'u': 'integer'}, ['6.25', '6.5'] valid
with a schema: [6.25, 6.5]
END
