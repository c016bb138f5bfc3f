#!/bin/sh
# pyreadr 0.5.8, pyreadstat 1.3.7: stamps of 1 kHz in a file for R are texts of whole seconds; for SPSS, Stata and SAS they are kept.
#
# A recording of a kilohertz with stamps goes to R (RDS). The stamps become texts without a fraction, so a thousand
# rows share one; the zone is dropped while the local time stays (13:00 in Berlin is 12:00 UTC); durations become texts such as "0 days 00:00:00.000500", and
# counts above 2^53 are rounded as they become floats. pyreadstat writes the same stamps to SAV, DTA and XPT within a microsecond. None of it warns. A format with a fraction, `datetimeformat="%Y-%m-%d %H:%M:%S.%f"`, keeps the texts exact.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pyreadr==0.5.8 pyreadstat==1.3.7 pandas==3.0.6 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import pandas as pd
import pyreadr
import pyreadstat

stamps = pd.date_range("2026-11-29 12:00:00.1234", periods=3, freq="1ms")
frame = pd.DataFrame({"stamp": stamps, "p1": [6.0, 6.1, 6.2]})


def through_r(frame, **keys):
    pyreadr.write_rds("rig.rds", frame, **keys)
    return pyreadr.read_r("rig.rds")[None]


def show(what, read, column):
    print(f"{what}:", *read[column], sep=" | ")


show("R", through_r(frame), "stamp")
show("R, format with %f", through_r(frame, datetimeformat="%Y-%m-%d %H:%M:%S.%f"), "stamp")
show("R, Berlin", through_r(pd.DataFrame({"stamp": stamps.tz_localize("UTC").tz_convert("Europe/Berlin")})), "stamp")
show("R, durations", through_r(pd.DataFrame({"lasts": pd.to_timedelta([0.0005, 1.5], unit="s")})), "lasts")
show("R, counts", through_r(pd.DataFrame({"count": [2**53 + 1, 2**53 + 3]})).map(int), "count")
for kind, write, read in (
    ("SPSS", pyreadstat.write_sav, pyreadstat.read_sav),
    ("Stata", pyreadstat.write_dta, pyreadstat.read_dta),
    ("SAS", pyreadstat.write_xport, pyreadstat.read_xport),
):
    write(frame, "rig.file")
    show(kind, read("rig.file")[0], "stamp")
END
diff - seen <<'END'
R: | 2026-11-29 12:00:00 | 2026-11-29 12:00:00 | 2026-11-29 12:00:00
R, format with %f: | 2026-11-29 12:00:00.123400 | 2026-11-29 12:00:00.124400 | 2026-11-29 12:00:00.125400
R, Berlin: | 2026-11-29 13:00:00 | 2026-11-29 13:00:00 | 2026-11-29 13:00:00
R, durations: | 0 days 00:00:00.000500 | 0 days 00:00:01.500000
R, counts: | 9007199254740992 | 9007199254740996
SPSS: | 2026-11-29 12:00:00.123400 | 2026-11-29 12:00:00.124399 | 2026-11-29 12:00:00.125401
Stata: | 2026-11-29 12:00:00.123399 | 2026-11-29 12:00:00.124399 | 2026-11-29 12:00:00.125399
SAS: | 2026-11-29 12:00:00.123400 | 2026-11-29 12:00:00.124400 | 2026-11-29 12:00:00.125400
END
