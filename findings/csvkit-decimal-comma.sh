#!/bin/sh
# csvkit 2.2.0: in a log with decimal commas 6,25 bar is 625, 6,375 is 6375, and 6,5 is 65.
#
# `in2csv`, `csvjson`, `csvstat`, `csvsort` and the rest find the semicolons of a European log by themselves, take each
# column for numbers, and drop the commas, as they read English thousands, wherever they stand. As a logger drops
# trailing zeros, each reading has a factor of its own: a pressure that rises goes from 625 to 6375, to 65 and to 12. No
# message. `--locale de_DE` is right, `--no-inference` leaves the text. Give the CSV itself.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile csvkit==2.2.0 agate==1.14.2 babel==2.18.0
export LC_ALL=C.UTF-8
printf 't;p1\n0,01;6,25\n0,02;6,375\n0,03;6,5\n0,04;12\n' >log.csv
{
    for options in "" "--locale de_DE" "--no-inference"; do
        echo "in2csv $options"
        v/bin/in2csv $options log.csv
    done
    echo "csvjson"
    v/bin/csvjson log.csv
    echo
    echo "csvsort -c p1"
    v/bin/csvsort -c p1 log.csv
    echo "csvstat --mean"
    v/bin/csvstat --mean log.csv
} | tee seen
diff - seen <<'END'
in2csv 
t,p1
1,625
2,6375
3,65
4,12
in2csv --locale de_DE
t,p1
0.01,6.25
0.02,6.375
0.03,6.5
0.04,12
in2csv --no-inference
t,p1
"0,01","6,25"
"0,02","6,375"
"0,03","6,5"
"0,04",12
csvjson
[{"t": 1.0, "p1": 625.0}, {"t": 2.0, "p1": 6375.0}, {"t": 3.0, "p1": 65.0}, {"t": 4.0, "p1": 12.0}]
csvsort -c p1
t,p1
4,12
3,65
1,625
2,6375
csvstat --mean
  1. t: 2.5
  2. p1: 1769.25
END
