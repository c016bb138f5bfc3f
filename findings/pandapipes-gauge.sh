#!/bin/sh
# pandapipes 0.16.0: `p_bar` of a network of air is a gauge pressure, its normal air is 1.4 % too light, and nothing chokes.
#
# A hose of 6 mm fed at `p_bar=6`: "the pressure of the external grid", says the help. The velocity belongs to 7.01 bar absolute, and at
# 2000 m of height to 6.7 bar, so that the same 6 is gauge, of the air around at that height. The normal volume flow is
# computed with 1.2743 kg/m3; air at 0 degC and 1.01325 bar has 1.2929. A larger flow leaves the hose with 516 m/s, and the next larger one
# with 776, converged without a word: air of 20 degC cannot be faster than 343 m/s there, and carries less.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pandapipes==0.16.0 numpy==2.4.6 pandas==2.3.3
v/bin/python -W ignore - <<'END' | tee seen
import logging
import math

import pandapipes as pp

logging.disable(logging.CRITICAL)


def hose(flow, height=0.0, length=0.01):
    """State of a hose of 6 mm that draws `flow` (kg/s) from air at p_bar = 6, length in m."""
    net = pp.create_empty_network(fluid="air")
    near, far = (pp.create_junction(net, pn_bar=6, tfluid_k=293.15, height_m=height) for _ in range(2))
    pp.create_ext_grid(net, near, p_bar=6, t_k=293.15)
    pp.create_sink(net, far, mdot_kg_per_s=flow)
    pp.create_pipe_from_parameters(net, near, far, length_km=length / 1000, inner_diameter_mm=6, k_mm=0.01)
    pp.pipeflow(net)
    return net.res_pipe.iloc[0]


for height in (0, 2000):
    pipe = hose(0.001, height)
    density = 0.001 / pipe.v_from_m_per_s / (math.pi * 0.006**2 / 4)
    print(f"{height} m: p_bar {pipe.p_from_bar:.2f}, density {density:.2f} kg/m3, {density * 287.05 * 293.15 / 1e5:.1f} bar absolute")
print(f"normal density {0.001 / hose(0.001).vdot_norm_m3_per_s:.4f} kg/m3")
for flow in (0.040, 0.046, 0.048):
    pipe = hose(flow, length=0.5)
    print(f"{flow * 1e3:.0f} g/s through 0.5 m: leaves at {pipe.v_to_m_per_s:.0f} m/s, p_bar {pipe.p_to_bar:.2f}")
END
diff - seen <<'END'
0 m: p_bar 6.00, density 8.28 kg/m3, 7.0 bar absolute
2000 m: p_bar 6.00, density 8.02 kg/m3, 6.7 bar absolute
normal density 1.2743 kg/m3
40 g/s through 0.5 m: leaves at 288 m/s, p_bar 3.16
46 g/s through 0.5 m: leaves at 516 m/s, p_bar 1.67
48 g/s through 0.5 m: leaves at 776 m/s, p_bar 0.85
END
