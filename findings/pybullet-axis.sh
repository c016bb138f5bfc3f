#!/bin/sh
# PyBullet 3.2.7: a hidden motor holds a piston against 240 N, or 1000 N, by the time step; it is damped, and has no friction.
#
# A mass of 1 kg on a prismatic joint, all else default. A motor that nobody asked for brakes it like dry friction: 239 N do not move it, and
# 250 N move it as 10 N would. In steps of 1 ms it holds 990 N, since its limit is an impulse for each step. A force by
# TORQUE_CONTROL does not replace it. With the motor's force set to 0, 10 N for 1 s give 8.7 m/s instead of 10, as
# each link has a damping of 0.04 that no URDF states; with this at 0 too, 10.0. The friction of 5 N in the URDF is read
# (`getJointInfo` shows it) and does nothing, while the damping beside it acts.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
python3 -m venv --without-pip v
python3 -m pip --python v/bin/python install --quiet --disable-pip-version-check --no-compile pybullet==3.2.7 numpy==2.4.6
v/bin/python -W ignore - <<'END' | tee seen
import pathlib

import pybullet as pb

BODY = '<inertial><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" iyz="0"/></inertial>'
URDF = f"""<robot name="axis"><link name="tube">{BODY.format(0, 0, 0, 0)}</link><link name="piston">{BODY.format(1, 1, 1, 1)}</link>
<joint name="slider" type="prismatic"><parent link="tube"/><child link="piston"/><axis xyz="1 0 0"/>
<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/>DYNAMICS</joint></robot>"""


def speed(force, dynamics="", motor=True, damping=True, joint_force=False, rate=240, seconds=1):
    """Velocity of a piston that a force pushes from rest, and the friction that its joint reports."""
    pathlib.Path("axis.urdf").write_text(URDF.replace("DYNAMICS", dynamics))
    pb.connect(pb.DIRECT)
    pb.setTimeStep(1 / rate)
    axis = pb.loadURDF("axis.urdf", useFixedBase=True)
    if not motor:
        pb.setJointMotorControl2(axis, 0, pb.VELOCITY_CONTROL, force=0)
    if not damping:
        pb.changeDynamics(axis, 0, linearDamping=0, angularDamping=0)
        pb.changeDynamics(axis, -1, linearDamping=0, angularDamping=0)
    for _ in range(rate * seconds):
        if joint_force:
            pb.setJointMotorControl2(axis, 0, pb.TORQUE_CONTROL, force=force)
        else:
            pb.applyExternalForce(axis, 0, [force, 0, 0], [0, 0, 0], pb.LINK_FRAME)
        pb.stepSimulation()
    velocity, friction = pb.getJointState(axis, 0)[1], pb.getJointInfo(axis, 0)[7]
    pb.disconnect()
    return f"{abs(velocity):.2f} m/s, friction reported {friction:g} N"


friction, damping, free = '<dynamics friction="5"/>', '<dynamics damping="10"/>', {"motor": False, "damping": False}
for force, rate in ((10, 240), (239, 240), (250, 240), (250, 1000), (990, 1000), (1010, 1000)):
    print(f"{force} N, {rate} Hz: {speed(force, rate=rate)}")
print("100 N by TORQUE_CONTROL:", speed(100, joint_force=True))
print("10 N, motor off:", speed(10, motor=False))
print("10 N, motor and damping off:", speed(10, **free))
print("10 N, friction of 5 N, motor and damping off:", speed(10, friction, **free))
print("10 N for 3 s, damping of 10 N s/m, motor and damping off:", speed(10, damping, seconds=3, **free))
END
diff - seen <<'END'
10 N, 240 Hz: 0.00 m/s, friction reported 0 N
239 N, 240 Hz: 0.00 m/s, friction reported 0 N
250 N, 240 Hz: 8.70 m/s, friction reported 0 N
250 N, 1000 Hz: 0.00 m/s, friction reported 0 N
990 N, 1000 Hz: 0.00 m/s, friction reported 0 N
1010 N, 1000 Hz: 8.70 m/s, friction reported 0 N
100 N by TORQUE_CONTROL: 0.00 m/s, friction reported 0 N
10 N, motor off: 8.70 m/s, friction reported 0 N
10 N, motor and damping off: 10.00 m/s, friction reported 0 N
10 N, friction of 5 N, motor and damping off: 10.00 m/s, friction reported 5 N
10 N for 3 s, damping of 10 N s/m, motor and damping off: 1.00 m/s, friction reported 0 N
END
