"""Shapes to draw: files of meshes, placement, and arguments that are wrong."""

import os
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import ROUNDING

S = ts.shapes
VERTICES = np.array(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), float)
FACES = np.array(((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
CORNERS = VERTICES[FACES]


def binary_stl(corners):
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in corners)
    return b"solid of a binary file".ljust(80) + struct.pack("<I", len(corners)) + body


def ascii_stl(corners):
    lines = ["solid tetrahedron"]
    for triangle in corners:
        places = (f"  vertex {x} {y} {z}" for x, y, z in triangle)
        lines += ["facet normal 0 0 0", "outer loop", *places, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]).encode()


OBJ = b"""# a square pyramid
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0.5 0.5 1
vn 0 0 1
f 4//1 3//1 2//1 1//1
f 1/1 2/2 -1/3
"""


@pytest.mark.parametrize("data", [binary_stl(CORNERS), ascii_stl(CORNERS)], ids=["binary", "ascii"])
def test_stl_files_are_read(data, tmp_path):
    (tmp_path / "part.STL").write_bytes(data)
    mesh = S.Mesh(tmp_path / "part.STL", scale=0.001)
    assert mesh.vertices.shape == (4, 3)
    np.testing.assert_allclose(mesh.vertices[mesh.faces], 0.001 * CORNERS, rtol=ROUNDING)


def test_obj_files_are_read(tmp_path):
    (tmp_path / "part.obj").write_bytes(OBJ)
    mesh = S.Mesh(str(tmp_path / "part.obj"))
    np.testing.assert_array_equal(mesh.faces, ((3, 2, 1), (3, 1, 0), (0, 1, 4)))
    np.testing.assert_array_equal(mesh.vertices[4], (0.5, 0.5, 1))


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("part.stl", b"no mesh", "no triangles"),
        ("part.stl", b"vertex 1 2 x", "can be read"),
        ("part.stl", binary_stl(CORNERS)[:-1], "can be read"),
        ("part.obj", b"v 0 0 0\nf 1 2 3", "indices from 0 to 0"),
        ("part.obj", b"v 0 0 a", "can be read"),
        ("part.obj", b"v 0 0\nf 1 1 1", "can be read"),
        ("part.obj", b"v nan 0 0\nf 1 1 1", "finite"),
        ("part.obj", b"f 1 1 " + b"9" * 100, "can be read"),
        ("part.obj", b"v 0 0 0\nf" + b" 1" * 2**16, "a line has more than 65536 bytes"),
    ],
)
def test_files_that_are_no_meshes_are_refused(name, data, words, tmp_path):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ts.InvalidFile, match=words):
        S.Mesh(tmp_path / name)


def test_polygons_make_a_bounded_number_of_triangles(tmp_path, monkeypatch):
    monkeypatch.setattr("tsdyn.shapes.MOST", 100)
    (tmp_path / "part.obj").write_text("v 0 0 0\n" + f"f{' 1' * 40}\n" * 3)
    with pytest.raises(ts.InvalidFile, match="more than 100"):
        S.Mesh(tmp_path / "part.obj")


def test_meshes_are_regular_files_of_bounded_size(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "device.stl").symlink_to("/dev/zero")
    (tmp_path / "folder.stl").mkdir()
    for name, words in {
        "pipe": "not a regular file",
        "device": "not a regular file",
        "folder": "a folder",
        "absent": "No such",
    }.items():
        with pytest.raises(ts.StorageError, match=words):
            S.Mesh(tmp_path / f"{name}.stl")
    monkeypatch.setattr("tsdyn.shapes.LARGEST", 100)
    (tmp_path / "part.stl").write_bytes(binary_stl(CORNERS))
    with pytest.raises(ts.StorageError, match=r"too large: .* may have 100 at most"):
        S.Mesh(tmp_path / "part.stl")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: S.Box((1, 2, 0)), "three positive lengths"),
        (lambda: S.Box((1, 2)), "size"),
        (lambda: S.Sphere(-1.0), "radius"),
        (lambda: S.Cylinder(1.0, 2.0, axis="w"), "'x', 'y' or 'z'"),
        (lambda: S.Box((1, 1, 1), rotation=np.ones((3, 3))), "rotation matrix"),
        (lambda: S.Box((1, 1, 1), position=(0, 0)), "position"),
        (lambda: S.Box((1, 1, 1), colour="rde"), "#rrggbb"),
        (lambda: S.Mesh((VERTICES, FACES, FACES)), "3 parts"),
        (lambda: S.Mesh((VERTICES, FACES + 1)), "indices"),
        (lambda: S.Mesh((VERTICES[:, :2], FACES)), "vertices"),
        (lambda: S.Mesh((VERTICES, FACES + 0.5)), "whole numbers"),
        (lambda: S.Mesh(7), "source must be the path"),
        (lambda: S.Mesh("part.dae"), r"must be an \.stl or \.obj file"),
    ],
)
def test_wrong_shapes_are_refused(make, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        make()


def test_shapes_with_mass_know_what_to_draw():
    """Where it is, through moves, turns and sums."""
    turn = Rotation.from_rotvec([0.0, 0.0, np.pi / 2])
    tool = (S.rod(1.0, axis="x", mass=1.0) + S.sphere(0.1, mass=2.0).moved((0.5, 0, 0))).rotated(turn).moved((0, 0, 3))
    stick, ball = tool.pieces
    assert (type(stick), type(ball)) == (S.Cylinder, S.Sphere)
    np.testing.assert_allclose(ball.position, (0, 0.5, 3), atol=ROUNDING)
    np.testing.assert_allclose(stick.rotation, turn.as_matrix(), atol=ROUNDING)
    assert S.from_mesh(VERTICES, FACES, mass=1.0).pieces[0].faces.shape == (4, 3)
