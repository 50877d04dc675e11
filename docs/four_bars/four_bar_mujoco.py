"""The four-bar in MuJoCo: hinges along a tree, and an equality that closes the loop. pip install mujoco."""

import data
import mujoco
import numpy as np

STEP = 1e-3  # s


def link(i, place, turn, length, inside=""):
    """A body that begins at a place of its parent, turned by an angle."""
    half, inertia = length / 2, data.INERTIAS[i]
    return f"""<body name="link{i}" pos="{place[0]:.17g} {place[1]:.17g} 0" euler="0 0 {turn:.17g}">
      <joint type="hinge" axis="0 0 1" name="pin{i}"/>
      <inertial pos="{half:.17g} 0 0" mass="{data.MASSES[i]}" diaginertia="{inertia} {inertia} {inertia}"/>
      {inside}</body>"""


first, second, third = data.ANGLES
coupler = link(1, (0.3, 0.0), second - first, 0.9)
crank, rocker = link(0, data.A, first, 0.3, coupler), link(2, data.D, third + np.pi, 0.7)
model = mujoco.MjModel.from_xml_string(f"""<mujoco><compiler angle="radian" eulerseq="xyz"/>
  <option gravity="0 {-data.GRAVITY} 0" timestep="{STEP}" integrator="RK4" tolerance="0" iterations="100"/>
  <worldbody>{crank}{rocker}</worldbody>
  <equality><connect body1="link1" body2="link2" anchor="0.9 0 0" solref="{2 * STEP} 1" solimp="0.9999 0.9999 0.001"/>
  </equality></mujoco>""")
run = mujoco.MjData(model)
one, two, three = data.rates()
run.qvel[:] = one, two - one, three
for _ in range(round(data.END / STEP)):
    mujoco.mj_step(model, run)
mujoco.mj_kinematics(model, run)
ends = [
    run.body(name).xpos + run.body(name).xmat.reshape(3, 3) @ (length, 0, 0)
    for name, length in (("link1", 0.9), ("link2", 0.7))
]
data.report("MuJoCo", 0.6 + run.qpos[0], np.linalg.norm(ends[0] - ends[1]))
