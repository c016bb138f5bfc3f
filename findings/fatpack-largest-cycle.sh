#!/bin/sh
# fatpack 0.7.8: of a fifth of load histories the largest cycle, which does most of the damage, is not counted.
#
# A load that wanders, 1000 samples. `find_rainflow_ranges` sorts the loads into 64 levels, counts, writes what is left
# over twice in a row and counts that. At the seam a point may stay that is no turning point; there the count stops, and
# the cycle from the lowest to the highest load is dropped with others. It is in any count, but missing in 44 of 200
# histories; the number of levels decides in which. rainflow has it in all 200. Damage by the fourth power falls to an
# eightieth. Nothing warns. Compare the largest range with `numpy.ptp`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile fatpack==0.7.8 rainflow==3.2.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import fatpack
import numpy as np
import rainflow

histories = [np.random.default_rng(seed).standard_normal(1000).cumsum() for seed in range(200)]


def found(load, levels):
    ranges = fatpack.find_rainflow_ranges(load, k=levels)
    return ranges.max() / np.ptp(load), (ranges**4).sum()


for levels in (32, 64, 128, 256):
    shares = np.array([found(load, levels)[0] for load in histories])
    print(f"fatpack, {levels} levels: largest cycle missing in {(shares < 0.99).sum()} of 200")
shares = [max(size for size, _ in rainflow.count_cycles(load)) / np.ptp(load) for load in histories]
print(f"rainflow: largest cycle missing in {sum(share < 0.99 for share in shares)} of 200")
load = histories[0]
for levels in (64, 1000):
    share, damage = found(load, levels)
    print(f"first history, {levels} levels: largest cycle {share:.2f} of the range, sum of fourth powers {damage:.3g}")
counted = sum(size**4 * count for size, count in rainflow.count_cycles(load))
print(f"first history, rainflow: sum of fourth powers {counted:.3g}")
left = fatpack.find_rainflow_cycles(fatpack.find_reversals(load)[0])[1]
seam = np.sign(np.diff(fatpack.concatenate_reversals(left, left)))
print("first history, directions of what is counted twice:", "".join("+" if step > 0 else "-" for step in seam))
END
diff - seen <<'END'
fatpack, 32 levels: largest cycle missing in 52 of 200
fatpack, 64 levels: largest cycle missing in 44 of 200
fatpack, 128 levels: largest cycle missing in 43 of 200
fatpack, 256 levels: largest cycle missing in 41 of 200
rainflow: largest cycle missing in 0 of 200
first history, 64 levels: largest cycle 0.27 of the range, sum of fourth powers 1.68e+05
first history, 1000 levels: largest cycle 1.00 of the range, sum of fourth powers 1.43e+07
first history, rainflow: sum of fourth powers 7.25e+06
first history, directions of what is counted twice: +-+-+++-+-+-
END
