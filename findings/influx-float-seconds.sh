#!/bin/sh
# influxdb-client 1.50.0: a frame whose index is seconds is written with one and the same stamp, and is one point in the database.
#
# A recording with seconds as its index, 0 to 1 ms. The stamps of the line protocol are the whole part, taken as nanoseconds: each
# row has the stamp 0, and InfluxDB keeps the last of points that share one. Whole milliseconds as an index are nanoseconds too.
# With real stamps and the precision of milliseconds, stamps of half milliseconds are cut, not rounded, so that two rows share one.
# A Timestamp with nanoseconds loses its last three digits. Nothing is raised or warned. Durations as an index are right, and NaN
# is left out.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile influxdb-client==1.50.0 pandas==3.1.1 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pandas as pd
from influxdb_client import Point, WritePrecision
from influxdb_client.client.write.dataframe_serializer import data_frame_to_list_of_points
from influxdb_client.client.write_api import PointSettings


def show(what, index, values=(6.0, 6.1, 6.2), **keys):
    frame = pd.DataFrame({"p1": list(values)}, index=index)
    print(f"{what}:", *data_frame_to_list_of_points(frame, PointSettings(), data_frame_measurement_name="rig", **keys), sep=" | ")


stamps = pd.date_range("2026-11-29 12:00", periods=3, freq="500us")
show("seconds", [0.0, 0.0005, 0.001])
show("milliseconds", [0, 1, 2])
show("durations", pd.to_timedelta([0.0, 0.0005, 0.001], unit="s"))
show("stamps", stamps)
show("stamps, precision ms", stamps, precision=WritePrecision.MS)
show("NaN", stamps, (6.0, np.nan, 6.2))
print("nanoseconds:", Point("rig").field("p1", 6.0).time(pd.Timestamp("2026-11-29 12:00:00.123456789")).to_line_protocol())
END
diff - seen <<'END'
seconds: | rig p1=6.0 0 | rig p1=6.1 0 | rig p1=6.2 0
milliseconds: | rig p1=6.0 0 | rig p1=6.1 1 | rig p1=6.2 2
durations: | rig p1=6.0 0 | rig p1=6.1 500000 | rig p1=6.2 1000000
stamps: | rig p1=6.0 1795953600000000000 | rig p1=6.1 1795953600000500000 | rig p1=6.2 1795953600001000000
stamps, precision ms: | rig p1=6.0 1795953600000 | rig p1=6.1 1795953600000 | rig p1=6.2 1795953600001
NaN: | rig p1=6.0 1795953600000000000 | rig p1=6.2 1795953600001000000
nanoseconds: rig p1=6 1795953600123456000
END
