#!/bin/sh
# sparkplug-payload 1.0.3 (npm) and pysparkplug 0.6.1: a position of -5 in an Int16 of the one cannot be read by the other.
#
# Both write and read payloads of Sparkplug B. A negative Int8 or Int16 is sent by the one with 32 bits, and refused by
# the other, which looks for 8 or 16; Int32 and Int64 pass. What does not fit is sent all the same: 40000 in an Int16 is
# 40000 in Node and -25536 in Python. Readings with decimals in a whole number are cut, 6.9 to 6; "6,25" in a Double is
# NaN; a stamp given as a `Date` is 1970. Node's own reader shows its -5 and 40000 as sent, so that the sender sees
# nothing. Send Int32 or Double, and stamps as numbers of milliseconds.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
for tool in node npm; do
    command -v "$tool" >/dev/null || { echo "this script needs $tool" >&2; exit 1; }
done
npm install --silent --no-audit --no-fund --prefix . sparkplug-payload@1.0.3
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pysparkplug==0.6.1
cat >run.cjs <<'END'
const { writeFileSync } = require("fs");
const payloads = require("sparkplug-payload").get("spBv1.0");

const sent = [
  ["Int8", -5], ["Int16", -5], ["Int32", -5], ["Int64", -5], ["Int16", 40000], ["Int16", 6.9], ["Double", "6,25"],
  ["DateTime", new Date(1767323045123)], ["DateTime", 1767323045123],
];
const all = sent.map(([type, value]) => {
  const bytes = payloads.encodePayload({ timestamp: 1, seq: 0, metrics: [{ name: "x", type, value }] });
  const shown = value instanceof Date ? value.toISOString() : value;
  return { sent: `${type} ${shown}`, node: String(payloads.decodePayload(bytes).metrics[0].value), bytes: [...bytes] };
});
writeFileSync("payloads.json", JSON.stringify(all));
END
node run.cjs
v/bin/python -W ignore - <<'END' | tee seen
import json

import pysparkplug

with open("payloads.json") as file:
    payloads = json.load(file)
for payload in payloads:
    try:
        value = pysparkplug.NData.decode(bytes(payload["bytes"])).metrics[0].value
    except OverflowError as error:
        value = f"OverflowError: {error}"
    print(f"sent {payload['sent']}: read by Node {payload['node']}, by Python {value}")
END
diff - seen <<'END'
sent Int8 -5: read by Node -5, by Python OverflowError: Int8 overflow with value 4294967291
sent Int16 -5: read by Node -5, by Python OverflowError: Int16 overflow with value 4294967291
sent Int32 -5: read by Node -5, by Python -5
sent Int64 -5: read by Node -5, by Python -5
sent Int16 40000: read by Node 40000, by Python -25536
sent Int16 6.9: read by Node 6, by Python 6
sent Double 6,25: read by Node NaN, by Python nan
sent DateTime 2026-01-02T03:04:05.123Z: read by Node 0, by Python 1970-01-01 00:00:00+00:00
sent DateTime 1767323045123: read by Node 1767323045123, by Python 2026-01-02 03:04:05.123000+00:00
END
