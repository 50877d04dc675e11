"""Bricard's six-bar in space: mobile only by its geometry."""

import numpy as np
from scipy.spatial.transform import Rotation

from ...constraints import Revolute
from ...simulation.scene import Scene

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)], float)  # m


def bricard():
    """Five rods of 1 m and the ground, along edges of a cube, on six Revolutes: one row follows from the others."""
    scene = Scene(gravity=(0.0, -9.81, 0.0))
    links = [scene.ground]
    for i in range(5):
        along = CORNERS[i + 1] - CORNERS[i]
        turn = Rotation.align_vectors([along], [(1.0, 0.0, 0.0)])[0]
        links.append(scene.add_body(1.0, (1 / 1200, 1 / 12, 1 / 12), CORNERS[i] + along / 2, turn, name=f"rod {i}"))
    for i in range(6):
        axis = np.cross(CORNERS[i] - CORNERS[i - 1], CORNERS[(i + 1) % 6] - CORNERS[i])
        scene.add(Revolute.at(links[i], links[(i + 1) % 6], point=CORNERS[i], axis=axis))
    return scene
