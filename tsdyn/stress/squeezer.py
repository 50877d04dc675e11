"""Andrews' squeezer: seven bodies in three loops, driven by a motor torque (Hairer and Wanner 1996, section VII.7).

Lengths in m, masses in kg, angles in rad, named as there; the mechanism lies in the plane z = 0.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..constraints import Revolute
from ..forces import Spring, Torque
from ..simulation.scene import Scene

MASS = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
INERTIA = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
D, DA, E, EA = 0.028, 0.0115, 0.02, 0.01421
RR, RA, SS, SA, SB, SC, SD = 0.007, 0.00092, 0.035, 0.01874, 0.01043, 0.018, 0.02
TA, TB, U, UA, UB, ZF, ZT, FA = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
STIFFNESS, FREE_LENGTH, MOTOR = 4530.0, 0.07785, 0.033  # N/m, m, N m
BETA, THETA = -0.0617138900142764496358948458001, 0.0
GAMMA, PHI = 0.455279819163070380255912382449, 0.222668390165885884674473185609
DELTA, EPSILON = 0.487364979543842550225598953530, 1.23054744454982119249735015568


def _turned(angle, x, y):
    """Return (x, y) turned by an angle, in the plane z = 0."""
    return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, 0.0])


def squeezer():
    """Andrews' squeezer at rest, on ten Revolutes: nine rows too many in space."""
    scene = Scene(gravity=(0.0, 0.0, 0.0))
    a, b, c = (np.array([*point, 0.0]) for point in (A, B, C))
    knee = _turned(BETA, RR, 0.0)
    meeting = knee - _turned(BETA + THETA, D, 0.0)  # of bodies 2, 3, 4 and 6
    left, right = a + _turned(DELTA, ZT, 0.0), a + _turned(EPSILON, 0.0, -U)
    omega = -PHI
    poses = (  # angle, centroid
        (BETA, _turned(BETA, RA, 0.0)),
        (BETA + THETA, knee - _turned(BETA + THETA, DA, 0.0)),
        (GAMMA, b + _turned(GAMMA, SB, -SA)),
        (PHI + DELTA, left + _turned(PHI + DELTA, 0.0, -(E - EA))),
        (DELTA, a + _turned(DELTA, TA, TB)),
        (omega + EPSILON, right + _turned(omega + EPSILON, ZF - FA, 0.0)),
        (EPSILON, a + _turned(EPSILON, -UB, -UA)),
    )
    bodies = [
        scene.add_body(
            mass, (inertia, inertia, inertia), centroid, Rotation.from_rotvec((0.0, 0.0, angle)), name=f"body {i}"
        )
        for i, (mass, inertia, (angle, centroid)) in enumerate(zip(MASS, INERTIA, poses, strict=True), 1)
    ]
    k1, k2, k3, k4, k5, k6, k7 = bodies
    ground, origin = scene.ground, np.zeros(3)
    joints = [(ground, k1, origin), (k1, k2, knee), (k2, k3, meeting), (k2, k4, meeting), (k2, k6, meeting)]
    joints += [(ground, k3, b), (ground, k5, a), (ground, k7, a), (k5, k4, left), (k7, k6, right)]
    for one, other, point in joints:
        scene.add(Revolute.at(one, other, point=point, axis=(0.0, 0.0, 1.0)))
    hook = (SD - SB, SA - SC, 0.0)  # from the centroid
    scene.add(Spring(k3, ground, point_a=hook, point_b=c, stiffness=STIFFNESS, free_length=FREE_LENGTH, name="spring"))
    scene.add(Torque(k1, torque=(0.0, 0.0, MOTOR), name="motor"))
    return scene


def angles(solution):
    """Return beta, gamma, delta and epsilon of a solution, rad, (k, 4), counted over turns."""
    found = []
    for number, start in ((1, BETA), (3, GAMMA), (5, DELTA), (7, EPSILON)):
        R = solution.rotation(f"body {number}")
        turned = np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
        found.append(turned + np.rint((start - turned[0]) / (2.0 * np.pi)) * 2.0 * np.pi)
    return np.stack(found, axis=1)
