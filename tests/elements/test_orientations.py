"""Orientations given as rotation matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import ROUNDING

HALF_TURNS = [np.diag(signs) for signs in ((1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0))]
MATRICES = [np.eye(3), *HALF_TURNS, *Rotation.from_quat(np.random.default_rng(1).normal(size=(20, 4))).as_matrix()]


@pytest.mark.parametrize("A", MATRICES)
def test_a_body_is_turned_as_the_matrix_says(A):
    """Added, or set; it may have seven digits."""
    scene = ts.Scene()
    bodies = [scene.add_body(1.0, (1, 1, 1), orientation=matrix) for matrix in (A, A.tolist(), A + 2e-7)]
    bodies.append(scene.add_body(1.0, (1, 1, 1)))
    bodies[-1].orientation = A
    for body, digits in zip(bodies, (ROUNDING, ROUNDING, 1e-6, ROUNDING), strict=True):
        p = body.orientation
        assert abs(p @ p - 1.0) < ROUNDING
        assert np.abs(Rotation.from_quat(np.roll(p, -1)).as_matrix() - A).max() < digits


def test_matrices_of_a_solution():
    scene = ts.Scene()
    top = scene.add_body(1.0, (1, 2, 2.5), orientation=(0.6, 0.8, 0, 0), angular_velocity=(1, 2, 3), name="top")
    solution = ts.simulate(scene, (0.0, 1.0))
    twin = ts.Scene().add_body(1.0, (1, 2, 2.5), orientation=solution.rotation(top)[-1])
    p = solution.orientation(top)[-1]
    assert np.abs(twin.orientation * np.sign(p[0]) - p).max() < ROUNDING


def test_matrices_of_scene_files(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        'version = 1\n[[body]]\nname = "a"\nmass = 1.0\ninertia = [1, 1, 1]\n'
        "orientation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]\n"
    )
    scene = ts.load(path)
    assert np.abs(scene.body("a").orientation - np.sqrt([0.5, 0, 0, 0.5])).max() < ROUNDING
    again = ts.load(scene.save(tmp_path / "again.toml"))
    assert (again.body("a").orientation == scene.body("a").orientation).all()
