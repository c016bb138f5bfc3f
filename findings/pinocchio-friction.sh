#!/bin/sh
# Pinocchio 4.1.0: it reads damping, friction and stops of a URDF, and its forward dynamics uses none of them.
#
# A slide of 2 kg with damping 25 N s/m, Coulomb friction 8 N and a stroke of 0.2 m. The model holds all of them. `aba`
# accelerates it at rest under 5 N, which friction would hold; at 1 m/s it needs no force, where 33 N are due, and `rnea`
# says so; `integrate` takes it through its end. A drive dimensioned by `rnea` has no force for friction.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pin==4.1.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import numpy as np
import pinocchio as pin

model = pin.buildModelFromXML("""<robot name="axis"><link name="frame"/><link name="slide"><inertial><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><joint name="x" type="prismatic"><parent link="frame"/>
<child link="slide"/><axis xyz="1 0 0"/><limit lower="0" upper="0.2" effort="100" velocity="2"/>
<dynamics damping="25" friction="8"/></joint></robot>""")
data = model.createData()
print("read: damping", *model.damping, "friction", *model.upperDryFrictionLimit, "end", *model.upperPositionLimit)
for velocity, force, due in ((0.0, 5.0, 0.0), (0.0, 20.0, 6.0), (1.0, 33.0, 0.0), (1.0, 0.0, -16.5)):
    found = pin.aba(model, data, np.zeros(1), np.array([velocity]), np.array([force]))
    print(f"v {velocity:g} m/s, force {force:g} N: aba {found[0]:g} m/s2, due {due:g}")
print("rnea: force at 1 m/s", *pin.rnea(model, data, np.zeros(1), np.ones(1), np.zeros(1)), "N, due 33")
print("integrate: 0.15 m and 0.2 m more:", *pin.integrate(model, np.array([0.15]), np.array([0.2])), "m")
END
diff - seen <<'END'
read: damping 25.0 friction 8.0 end 0.2
v 0 m/s, force 5 N: aba 2.5 m/s2, due 0
v 0 m/s, force 20 N: aba 10 m/s2, due 6
v 1 m/s, force 33 N: aba 16.5 m/s2, due 0
v 1 m/s, force 0 N: aba 0 m/s2, due -16.5
rnea: force at 1 m/s 0.0 N, due 33
integrate: 0.15 m and 0.2 m more: 0.35 m
END
