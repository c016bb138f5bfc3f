#!/bin/sh
# MuJoCo 4.0.0: a joint with "frictionloss" does not stick: below the friction it creeps, as if the friction were viscous.
#
# A mass of 2 kg on a slide with frictionloss 5 N is pushed for 5 s. At 2.0 N it moves at 1.1 mm/s, at 4.9 N at 2.6 mm/s:
# about 1900 N s/m, the same for steps of 1 and 5 ms; for 20 kg, a tenth of the velocity. Above the friction the velocity
# is what Coulomb and viscous friction give: (15 - 5) N over damping 10 N s/m is 1 m/s. What is called Coulomb friction
# here has no break-away, and its creep depends on the mass.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile mujoco==4.0.0 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import mujoco


def velocity(force, damping=0.0, mass=2.0, step=0.001):
    axis = mujoco.MjModel.from_xml_string(f'''<mujoco><option timestep="{step}" gravity="0 0 0"/>
        <worldbody><body><joint name="x" type="slide" axis="1 0 0" frictionloss="5" damping="{damping}"/>
        <geom size="0.1" mass="{mass}"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>''')
    state = mujoco.MjData(axis)
    state.ctrl[0] = force
    for _ in range(round(5 / step)):
        mujoco.mj_step(axis, state)
    return state.qvel[0]


for force in (2.0, 4.0, 4.9):
    print(f"{force} N of 5 N: {1e3 * velocity(force):.2f} mm/s")
print(f"4.9 N, step 5 ms: {1e3 * velocity(4.9, step=0.005):.2f} mm/s")
print(f"4.9 N, 20 kg: {1e3 * velocity(4.9, mass=20.0):.2f} mm/s")
print(f"15 N, damping 10 N s/m: {velocity(15.0, damping=10.0):.3f} m/s")
END
diff - seen <<'END'
2.0 N of 5 N: 1.06 mm/s
4.0 N of 5 N: 2.11 mm/s
4.9 N of 5 N: 2.59 mm/s
4.9 N, step 5 ms: 2.59 mm/s
4.9 N, 20 kg: 0.26 mm/s
15 N, damping 10 N s/m: 1.000 m/s
END
