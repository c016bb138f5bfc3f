#!/bin/sh
# sysidentpy 0.9.0: a good model has the score of none where the recording is a row and the prediction a column.
#
# `predict` gives a column. Beside the recording as it was read, a row, each reading is compared with each prediction:
# a model that is 0.1 off has a mean square of 16.5 and an R2 of -1, without an error. scikit-learn has 0.010 and
# 0.999 for the same arrays, as has sysidentpy for two columns, `recorded.reshape(-1, 1)`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile sysidentpy==0.9.0 scikit-learn==1.9.1 numpy==2.3.5 scipy==1.17.1 matplotlib==3.11.2
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import sklearn.metrics
import sysidentpy.metrics

recorded = np.arange(10.0)
predicted = recorded[:, None] + 0.1
names = ("mean_squared_error", "mean_absolute_error", "root_relative_squared_error", "r2_score")
for name in names:
    own, other = getattr(sysidentpy.metrics, name), getattr(sklearn.metrics, name, None)
    row, column = own(recorded, predicted), own(recorded[:, None], predicted)
    there = f", scikit-learn {other(recorded, predicted):.3f}" if other else ""
    print(f"{name}: recorded as row {row:.3f}, as column {column:.3f}{there}")
END
diff - seen <<'END'
mean_squared_error: recorded as row 16.510, as column 0.010, scikit-learn 0.010
mean_absolute_error: recorded as row 3.310, as column 0.100, scikit-learn 0.100
root_relative_squared_error: recorded as row 4.473, as column 0.035
r2_score: recorded as row -1.001, as column 0.999, scikit-learn 0.999
END
