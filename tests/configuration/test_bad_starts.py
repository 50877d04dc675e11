"""Starts that contradict the constraints, and rows that depend on each other, are refused by name."""

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.refusals import STEP, build, refuse

C = ts.constraints


def doubled(w, *names):
    for name in names:
        w.scene.add(C.Spherical(w.rod, w.ground, point_a=(-1, 0, 0), name=name))


def planes(w):
    for name, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("diagonal", (1, 1, 0))):
        offset = w.bead.position @ axis / np.linalg.norm(axis)
        w.scene.add(C.Dot2(w.ground, w.bead, axis_a=axis, value=offset, name=name))


def distances(w):
    for i in range(4):
        w.scene.add(C.Distance(w.bead, w.ground, point_b=(i, 0.5 * i, i * i), name=f"string {i}"))


def hinges(w):
    w.scene.add(C.Spherical(w.rod, w.ground, point_a=(1, 0, 0), point_b=(2, 0, 0), name="far pivot"))


def straight(w):
    """Two strings in one line: they depend on each other here and nowhere else."""
    w.bead.position = (0.0, 3.0, 0.0)
    for name, y in (("left", 2.0), ("right", 5.0)):
        w.scene.add(C.Distance(w.bead, w.ground, point_b=(0.0, y, 0.0), name=name))


def place(w, **values):
    for name, value in values.items():
        setattr(w.rod, name, value)


SCENES = [
    ("position", lambda w: place(w, position=(1.25, 0, 0)), ts.InconsistentState, ("pivot[0]", "0.25", "assemble")),
    ("position, three rows", lambda w: place(w, position=(1, 2, 3)), ts.InconsistentState, ("pivot[1]", "pivot[2]")),
    ("orientation", lambda w: place(w, orientation=(0, 0, 0, 1)), ts.InconsistentState, ("pivot[0]", "2", "pose")),
    (
        "velocity",
        lambda w: place(w, velocity=(0.25, 0, 0)),
        ts.InconsistentState,
        ("pivot[0]", "0.25", "velocit", "assemble"),
    ),
    (
        "angular velocity",
        lambda w: place(w, angular_velocity=(0, 0, 0.5)),
        ts.InconsistentState,
        ("pivot[1]", "0.5", "velocit"),
    ),
    ("duplicate", lambda w: doubled(w, "copy"), ts.RedundantConstraints, ("copy[0]", "pivot[0]", "Remove")),
    ("combination", planes, ts.RedundantConstraints, ("diagonal", "x", "y", "Remove")),
    ("more rows than coordinates", distances, ts.RedundantConstraints, ("string", "Remove")),
    ("two pivots on one body", hinges, ts.RedundantConstraints, ("pivot[0]", "far pivot[0]", "1 of the 7")),
    (
        "singular configuration",
        straight,
        (ts.RedundantConstraints, ts.SingularConfiguration),
        ("right", "left", "configuration"),
    ),
    (
        "row that vanishes",
        lambda w: w.scene.add(Parabola(w.bead, name="parabola")) and setattr(w.bead, "position", (0, 0, 0)),
        ts.SingularConfiguration,
        ("parabola", "another configuration"),
    ),
]


class Parabola(ts.Primitive):
    """z^2 = 0: its row of Phi_q vanishes where it holds."""

    rows = 1
    markers = (ts.Point("a"),)

    def __init__(self, a, *, name=""):
        super().__init__(a, None, ((0.0, 0.0, 0.0),), name)

    @staticmethod
    def phi(x, par, t, out):
        out[0] = x[2] * x[2]

    @staticmethod
    def jacobian(x, par, t, out):
        out[0, 2] = 2.0 * x[2]

    @staticmethod
    def gamma(x, xd, par, t, out):
        out[0] = 2.0 * xd[2] * xd[2]


@pytest.mark.slow_for("row that vanishes")
@pytest.mark.parametrize(("change", "error", "words"), [s[1:] for s in SCENES], ids=[s[0] for s in SCENES])
def test_scenes(change, error, words):
    w = build()
    change(w)
    refuse(lambda: ts.simulate(w.scene, (0.0, 1.0), integrator=STEP, redundancy="refuse"), error, words)


def test_dependent_rows_without_names_are_told_apart():
    scene = ts.Scene()
    rod = scene.add_body(1.0, (1.0, 1.0, 1.0), name="rod")
    for _ in range(2):
        scene.add(C.Spherical(rod, scene.ground))
    with pytest.raises(ts.RedundantConstraints) as caught:
        ts.simulate(scene, (0.0, 1.0), redundancy="refuse")
    lines = [line.split(" depends on ") for line in str(caught.value).splitlines() if " depends on " in line]
    assert len(lines) == 3
    assert all(row.strip() not in others for row, others in lines), str(caught.value)


def test_a_normalisation_is_never_the_row_to_remove():
    w = build()
    hinges(w)
    with pytest.raises(ts.RedundantConstraints) as caught:
        ts.simulate(w.scene, (0.0, 1.0), redundancy="refuse")
    assert not [line for line in str(caught.value).splitlines() if line.strip().startswith("EulerNormalization")]


def test_every_inconsistent_row_is_listed_or_counted():
    scene = ts.Scene()
    for i in range(12):
        scene.add(C.Dot2(scene.ground, scene.add_point_mass(1.0), axis_a=(0, 0, 1), value=1.0 + i, name=f"level {i}"))
    with pytest.raises(ts.InconsistentState, match="12 constraint rows") as caught:
        ts.simulate(scene, (0.0, 1.0))
    listed = str(caught.value).count("Phi = ")
    assert f"and {12 - listed} more" in str(caught.value)
    assert "level 11: Phi = -12" in str(caught.value)


def test_a_flat_parallelogram_is_refused_with_its_degrees_of_freedom():
    scene = ts.Scene()
    links = [scene.add_body(1.0, (1e-5, 0.01, 0.01), position=(x, 0, 0)) for x in (0.2, 0.525, 0.45)]
    joints = zip(
        (scene.ground, *links), (*links, scene.ground), (0.0, 0.4, 0.65, 0.25), ("hip", "A", "B", "D"), strict=True
    )
    for a, b, x, name in joints:
        scene.add(ts.constraints.Revolute.at(a, b, point=(x, 0, 0), axis=(0, 1, 0), name=name))
    said = "17 are independent here, so 1 direction is free at this point and none next to it.* just here"
    with pytest.raises(ts.SingularConfiguration, match=said):
        scene.inverse_dynamics({"hip": 0.0}, ["hip"], [0.0])
