"""Toy stages under the names of the real ones, so that the commands can be tried without any computation."""

PIPELINE = """\
# the bench by the window
[pipeline]
name = "bench"

[rig]
supply_pressure = "7 bar"  # the regulator

[signals]
time = { column = "t", unit = "s" }
p1 = { column = "p", unit = "bar" }

[[recordings]]
name = "step"
file = "raw.csv"
experiment = "valve"
use = "test"

[model]
effects = ["valve-lag"]  # found last week

[checks]
"compare.error.test" = { max = 1.5 }
"""
