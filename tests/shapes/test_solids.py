"""Mass and inertia of shapes: closed forms, sums, meshes that are exact and meshes that are wrong."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers.tolerances import CLOSE, FAIR, HELD, NEAR, ROUNDING, TIGHT

S = ts.shapes
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)


def hull(points):
    """Vertices and triangles of a convex hull, counterclockwise from outside."""
    mesh = ConvexHull(points)
    faces = mesh.simplices.copy()
    a, b, c = (mesh.points[faces[:, i]] for i in range(3))
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), mesh.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return mesh.points, faces


def test_a_shape_makes_a_body():
    scene = ts.Scene()
    body = scene.add_body(**S.box((1.0, 2.0, 3.0), density=2.0), position=(1, 0, 0), name="block")
    assert body.mass == pytest.approx(12.0)
    np.testing.assert_allclose(body.inertia, np.diag([13.0, 10.0, 5.0]), rtol=ROUNDING)
    assert ts.simulate(scene, (0.0, 0.1)).success


@pytest.mark.parametrize(
    ("shape", "mass", "inertia"),
    [
        (S.sphere(0.5, mass=2.0), 2.0, (0.2, 0.2, 0.2)),
        (S.sphere(1.0, density=3.0), 4 * np.pi, [1.6 * np.pi] * 3),
        (S.sphere(1.0, inner=1.0 - 1e-9, mass=3.0), 3.0, [2.0] * 3),  # a shell: 2/3 m r^2
        (S.cylinder(0.5, 2.0, mass=4.0), 4.0, (4 * (0.75 + 4) / 12, 4 * (0.75 + 4) / 12, 0.5)),
        (S.cylinder(0.5, 2.0, axis="x", density=1.0), np.pi / 2, np.pi / 2 * np.array([0.125, 4.75 / 12, 4.75 / 12])),
        (S.cylinder(1.0, 2.0, inner=0.5, mass=1.0), 1.0, (7.75 / 12, 7.75 / 12, 0.625)),
        (S.rod(3.0, axis="y", mass=4.0), 4.0, (3.0, 0.0, 3.0)),
    ],
    ids=["ball", "dense ball", "shell", "cylinder", "dense cylinder", "tube", "rod"],
)
def test_closed_forms(shape, mass, inertia):
    assert shape.mass == pytest.approx(mass, rel=ROUNDING)
    np.testing.assert_allclose(shape.inertia, np.diag(inertia), rtol=NEAR, atol=ROUNDING)


def test_a_box_of_triangles_is_a_box(rng):
    """Wherever it is, however it is turned, far away or small."""
    size, turn, place = np.array([1.0, 2.0, 0.5]), Rotation.random(random_state=1), np.array([1e4, -2e4, 5.0])
    vertices, faces = hull(turn.apply((CUBE - 0.5) * size) + place)
    mesh = S.from_mesh(vertices, faces, density=3.0)
    box = S.box(size, density=3.0).rotated(turn).moved(place)
    assert mesh.mass == pytest.approx(box.mass, rel=CLOSE)
    np.testing.assert_allclose(mesh.inertia, box.inertia, rtol=NEAR, atol=NEAR)
    np.testing.assert_allclose(mesh.centroid, box.centroid, rtol=HELD)
    tiny = S.from_mesh(vertices * 1e-6, faces, mass=1.0)
    np.testing.assert_allclose(tiny.inertia, S.from_mesh(vertices, faces, mass=1.0).inertia * 1e-12, rtol=FAIR)


def test_a_mesh_with_a_cavity():
    vertices, faces = hull(CUBE)
    inside, turned = 0.25 + 0.5 * vertices, faces[:, ::-1] + len(vertices)
    hollow = S.from_mesh(np.concatenate((vertices, inside)), np.concatenate((faces, turned)), density=8.0)
    assert hollow.mass == pytest.approx(7.0)
    expected = S.box((1, 1, 1), density=8.0).inertia - S.box((0.5, 0.5, 0.5), density=8.0).inertia
    np.testing.assert_allclose(hollow.inertia, expected, atol=ROUNDING)


def test_random_polyhedra_are_sums_of_their_halves(rng):
    """Cut by a plane, the halves' moments add up: by another sum of tetrahedra."""
    points = rng.normal(size=(40, 3))
    whole = S.from_mesh(*hull(points), density=2.0)
    simplices = ConvexHull(points).simplices
    parts = []
    for triangle in simplices:
        corners = np.vstack((points[triangle], [points.mean(axis=0)]))
        parts.append(S.from_mesh(*hull(corners), density=2.0))
    total = sum(parts[1:], parts[0])
    assert total.mass == pytest.approx(whole.mass, rel=HELD)
    np.testing.assert_allclose(total.centroid, whole.centroid, atol=HELD)
    np.testing.assert_allclose(total.inertia, whole.inertia, atol=TIGHT)


def test_a_dumbbell():
    ball = S.sphere(0.1, mass=1.0)
    body = ball.moved((0, 0, 1)) + ball.moved((0, 0, -1)) + S.rod(2.0, mass=0.3)
    np.testing.assert_allclose(np.diag(body.inertia), [2.108, 2.108, 0.008], rtol=ROUNDING)
    np.testing.assert_allclose(body.centroid, 0.0, atol=1e-16)


VERTICES, FACES = hull(CUBE)
TURNED = FACES.copy()
TURNED[3] = TURNED[3][::-1]
BAD = {
    "neither": (lambda: S.box((1, 1, 1)), "either mass= in kg or density="),
    "both": (lambda: S.sphere(1, mass=1, density=1), "either mass= in kg or density="),
    "flat box": (lambda: S.box((1, 0, 1), mass=1), "three positive lengths"),
    "two sizes": (lambda: S.box((1, 1), mass=1), "size"),
    "radius": (lambda: S.sphere(-1.0, mass=1), "radius"),
    "inner": (lambda: S.cylinder(1.0, 1.0, inner=1.0, mass=1), "inner must be a radius from 0 to less than 1"),
    "axis": (lambda: S.rod(1.0, mass=1, axis=2), "axis must be 'x', 'y' or 'z'"),
    "mass": (lambda: S.rod(1.0, mass=np.nan), "mass"),
    "density": (lambda: S.box((1, 1, 1), density="steel"), "density"),
    "sum": (lambda: S.sphere(1, mass=1) + 1, "added to a shape only"),
    "mirror": (lambda: S.sphere(1, mass=1).rotated(-np.eye(3)), "rotation matrix"),
    "open": (lambda: S.from_mesh(VERTICES, FACES[:-1], mass=1), r"not closed: the edge \[\d, \d\] of face"),
    "turned": (lambda: S.from_mesh(VERTICES, TURNED, mass=1), r"faces \[\d+, \d+\] go along the edge"),
    "inward": (lambda: S.from_mesh(VERTICES, FACES[:, ::-1], mass=1), r"inward; reverse them: faces\[:, ::-1\]"),
    "index": (lambda: S.from_mesh(VERTICES, FACES + 1, mass=1), "8 vertices, from 0"),
    "floats": (lambda: S.from_mesh(VERTICES, FACES * 1.0, mass=1), "whole numbers"),
    "quads": (lambda: S.from_mesh(VERTICES, [[0, 1, 3, 2]], mass=1), "into triangles"),
    "twice": (lambda: S.from_mesh(VERTICES, [[0, 0, 1]], mass=1), "a vertex twice"),
    "nan": (lambda: S.from_mesh(VERTICES * np.nan, FACES, mass=1), "finite"),
    "plane": (lambda: S.from_mesh(VERTICES[:3], [[0, 1, 2], [0, 2, 1]], mass=1), "no volume"),
    "soup": (lambda: S.from_mesh(VERTICES[FACES].reshape(-1, 3), np.arange(FACES.size).reshape(-1, 3), mass=1), "uniq"),
}


CALLS = {
    "nothing": (lambda: S.box(), "box.*size"),
    "misspelt": (lambda: S.box((1, 1, 1), densty=3), "did you mean density"),
    "a file": (lambda: S.from_mesh("x.stl", density=1), "from_mesh.*faces"),
    "by position": (lambda: S.sphere(1.0, 0.5), "takes radius by position"),
    "to draw": (lambda: S.Box((1, 1, 1), color="red"), r"Box\(\) has no argument color; did you mean colour"),
    "mesh": (lambda: S.Mesh(), "Mesh.*source"),
}


@pytest.mark.parametrize(("call", "words"), CALLS.values(), ids=CALLS)
def test_calls_that_do_not_fit(call, words):
    with pytest.raises(ts.InvalidCall, match=words):
        call()


@pytest.mark.parametrize(("call", "words"), BAD.values(), ids=BAD)
def test_bad_shapes(call, words):
    with pytest.raises(ts.InvalidArgument, match=words):
        call()
