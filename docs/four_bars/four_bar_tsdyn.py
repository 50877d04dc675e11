"""The four-bar in tsdyn: python four_bar_tsdyn.py."""

import data
import numpy as np
from scipy.spatial.transform import Rotation

import tsdyn as ts

scene = ts.Scene(gravity=(0, -data.GRAVITY, 0))
bodies = []
for (first, last), mass, inertia, angle in zip(data.LINKS, data.MASSES, data.INERTIAS, data.ANGLES, strict=True):
    middle, turn = np.append((first + last) / 2, 0), Rotation.from_rotvec((0, 0, angle))
    bodies.append(scene.add_body(mass, (inertia, inertia, inertia), middle, turn))
chain = [scene.ground, *bodies, scene.ground]
for a, b, point in zip(chain, chain[1:], (data.A, data.B, data.C, data.D), strict=False):
    joint = scene.add(ts.constraints.Revolute.at(a, b, point=np.append(point, 0), axis=(0, 0, 1)))
bearing = scene.constraints[0]
scene.set(bearing, rate=data.RATE)

solution = ts.simulate(scene, (0, data.END))
data.report("tsdyn", 0.6 + solution.angle(bearing)[-1], solution.constraint_error.position[-1])
