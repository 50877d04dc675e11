"""Joints as users meet them: their rows, row names, geometry from the ground frame."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tsdyn as ts
from tests.helpers import minimal_coordinates as minimal
from tests.helpers.built_in import JOINTS, by_name
from tests.helpers.joints import X, Y, Z, build, made, posed, residuals
from tests.helpers.tolerances import EPS, EXACT, HELD
from tsdyn.elements.joint import across

C = ts.constraints


# what they are made of


@pytest.mark.slow_but("0-Revolute", "0-Parallel")
@pytest.mark.parametrize("kind", JOINTS, **by_name)
@pytest.mark.parametrize("seed", range(3))
def test_parts_and_assembled_rows_are_derivatives_of_phi(kind, seed):
    """Of Phi: Phi_q, gamma and the series, kernels and assembled, by complex steps and truncated series."""
    ts.testing.check_primitive(kind, seed=seed)


def by_hand(scene, rod, arm):
    """Revolute.at(rod, arm, point=(2, 0, 0), axis=X) of primitives."""
    scene.add(C.Spherical(rod, arm, point_a=(1, 0, 0), point_b=(-1, 0, 0)))
    for axis in across(X):
        scene.add(C.Dot1(rod, arm, axis_a=axis, axis_b=X))


def test_a_joint_is_its_rows_and_nothing_more():
    """The packed system is that of the same primitives written by hand, so it costs what they cost."""
    scenes = [build() for _ in range(2)]
    scenes[0][0].add(made("Revolute", *scenes[0][1:]))
    by_hand(*scenes[1])
    one, other = (scene.system for scene, _, _ in scenes)
    for field, a, b in zip(one._fields, one, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=field)


def test_joints_share_the_kernels_of_their_rows():
    scene, rod, arm = build()
    for kind in ("Revolute", "Cylindrical", "Translational", "Planar", "PointOnLine"):
        scene.add(made(kind, rod, arm))
    assert {type(part) for part in scene.primitives} == {C.Spherical, C.Dot1, C.Dot2, C.EulerNormalization}
    assert not any(hasattr(kind, "kernels") for kind in JOINTS)


@pytest.mark.parametrize("axis", [*np.eye(3), (1, 1, 1), (1e-9, 1, 0), (1, 1 + 1e-9, 1), (0, 0, -1)], ids=str)
def test_directions_across_an_axis_are_orthonormal(axis):
    f, g = across(axis)
    frame = np.stack([f, g, np.divide(axis, np.linalg.norm(axis))])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=4 * EPS)
    assert np.linalg.det(frame) > 0.0


@pytest.mark.parametrize("kind", ["Revolute", "Translational", "Fixed"])
def test_rows_that_turn_are_orthonormal(kind, rng):
    """In terms of a small relative rotation the direction rows are of unit length and at right angles."""
    _, rod, arm = posed(rng)
    joint = getattr(C, kind).at(rod, arm, point=rod.position, axis=rng.normal(size=3))
    A, B = (body_matrix(body) for body in (rod, arm))
    turning = [part for part in joint.parts if isinstance(part, C.Dot1)]
    rows = np.array([np.cross(B @ part.axis_b, A @ part.axis_a) for part in turning])
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=20 * EPS)


def body_matrix(body):
    return Rotation.from_quat(np.roll(body.orientation, -1)).as_matrix()


# names


def test_row_names_say_the_joint_its_name_and_the_row():
    scene, rod, arm = build()
    scene.add(made("Revolute", scene.ground, rod, name="hinge"))
    scene.add(made("Translational", rod, arm))
    scene.add(made("Universal", rod, arm, name="Universal of the rod"))
    scene.add(C.Spherical(rod, arm, point_a=(1, 0, 0), point_b=(-1, 0, 0), name="ball"))
    assert scene.row_names() == [
        *(f"Revolute 'hinge' {row}" for row in ("point[0]", "point[1]", "point[2]", "axis[0]", "axis[1]")),
        *(f"Translational(rod, arm) {row}" for row in ("axis[0]", "axis[1]", "turn", "line[0]", "line[1]")),
        *(f"Universal of the rod {row}" for row in ("point[0]", "point[1]", "point[2]", "cross")),
        *(f"ball[{i}]" for i in range(3)),
        "EulerNormalization(rod)",
        "EulerNormalization(arm)",
    ]
    assert [part.name for part in scene.constraints[0].parts] == [
        "Revolute 'hinge' point",
        "Revolute 'hinge' axis[0]",
        "Revolute 'hinge' axis[1]",
    ]
    assert len(scene.constraints) == 6
    assert len(scene.primitives) == 3 + 5 + 2 + 1 + 2


def test_joints_of_one_name_are_told_apart():
    scene, rod, arm = build()
    for _ in range(2):
        scene.add(made("Revolute", rod, arm))
    assert "Revolute(rod, arm) #2 axis[1]" in scene.row_names()
    with pytest.raises(ts.RedundantConstraints, match=r"Revolute\(rod, arm\) #2 axis\[1\] depends on Revolute"):
        ts.simulate(scene, (0.0, 1.0), redundancy="refuse")


def test_an_inconsistent_start_names_the_row():
    scene, rod, arm = build()
    scene.add(made("Cylindrical", rod, arm, name="rail"))
    arm.position = (3.0, 0.25, 0.0)
    with pytest.raises(ts.InconsistentState, match=r"Cylindrical 'rail' line\[\d\]: Phi = -?0\.25"):
        ts.simulate(scene, (0.0, 1.0))
    scene.assemble()
    rod.angular_velocity = (0.0, 1.0, 0.0)
    with pytest.raises(ts.InconsistentState, match=r"Cylindrical 'rail' axis\[\d\]: Phi_q qd"):
        ts.simulate(scene, (0.0, 1.0))


def test_redundant_rows_are_named():
    """A door on two hinges: the second says one thing that is new, if anything."""
    scene, rod, _ = build()
    for name, z in (("upper", 0.5), ("lower", -0.5)):
        scene.add(C.Revolute.at(scene.ground, rod, point=(0, 0, z), axis=Z, name=name))
    with pytest.raises(ts.RedundantConstraints) as caught:
        ts.simulate(scene, (0.0, 1.0), redundancy="refuse")
    message = str(caught.value)
    assert "5 of the 12 constraint rows" in message
    assert "Revolute 'lower' axis[0]" in message
    assert "Revolute 'upper' axis[0]" in message


@pytest.mark.slow
def test_taylor_names_the_joint_whose_part_has_no_series():
    class Bare(C.Dot1):
        series = None

    class Half(ts.Joint):
        markers = (ts.Vector("a"), ts.Vector("b"))

        def __init__(self, a, b, *, axis_a, axis_b, name=""):
            super().__init__(a, b, (axis_a, axis_b), name)

        def compose(self):
            yield "angle", Bare(self.a, self.b, axis_a=self.axis_a, axis_b=self.axis_b)

    scene, rod, arm = build()
    scene.add(Half(rod, arm, axis_a=X, axis_b=Y, name="lock"))
    with pytest.raises(ts.InvalidArgument, match=r"Half 'lock' angle.*Bare has no kernel"):
        ts.simulate(scene, (0.0, 1.0), integrator="taylor")


# geometry


@pytest.mark.parametrize("kind", minimal.JOINTS)
def test_at_holds_where_the_bodies_are(kind, rng):
    scene, rod, arm = posed(rng)
    Q = Rotation.random(random_state=rng).as_matrix()
    for pair in ((rod, arm), (rod, scene.ground), (scene.ground, arm)):
        scene.add(minimal.JOINTS[kind][1](*pair, rng.normal(size=3), Q))
        assert np.abs(residuals(scene)).max() < 20 * EPS


def test_at_is_the_same_as_the_body_frames(rng):
    scene, rod, arm = posed(rng)
    point, axis = rng.normal(size=3), rng.normal(size=3)
    joint = C.Revolute.at(rod, arm, point=point, axis=axis, name="hinge")
    assert joint.name == "hinge"
    for body, letter in ((rod, "a"), (arm, "b")):
        A = body_matrix(body)
        np.testing.assert_allclose(getattr(joint, f"point_{letter}"), A.T @ (point - body.position), atol=20 * EPS)
        expected = A.T @ axis / np.linalg.norm(axis)
        np.testing.assert_allclose(getattr(joint, f"axis_{letter}"), expected, atol=20 * EPS)
    fixed = C.Revolute.at(scene.ground, arm, point=point, axis=axis)
    np.testing.assert_array_equal(fixed.point_a, point)


def test_at_takes_a_pair_or_one_of_it(rng):
    _, rod, arm = posed(rng)
    a, b = rng.normal(size=(2, 3))
    rod_point = body_matrix(rod).T @ (a - rod.position)
    for joint in (
        C.Distance.at(rod, arm, point_a=a, point_b=b, length=2.0),
        ts.forces.Spring.at(rod, arm, point_a=a, point_b=b, stiffness=3.0),
        C.Spherical.at(rod, arm, point=b, point_a=a),
    ):
        np.testing.assert_allclose(joint.point_a, rod_point, atol=20 * EPS)
    assert C.Distance.at(rod, arm, point_a=a, point_b=b).length == pytest.approx(np.linalg.norm(a - b))
    contact = C.PlaneContact.at(rod, arm, point=a, normal=b)
    np.testing.assert_allclose(contact.normal_b, body_matrix(arm).T @ b / np.linalg.norm(b), atol=20 * EPS)
    push = ts.forces.PointForce.at(rod, point=a, force=(1, 0, 0))
    np.testing.assert_allclose(push.point_a, rod_point, atol=20 * EPS)


def test_a_point_mass_on_a_line():
    scene, *_ = build()
    bead = scene.add_point_mass(1.0, position=(0.1, 0.2, 0.3), velocity=(1.0, 0.0, 0.0))
    line = scene.add(C.PointOnLine.at(bead, scene.ground, point=bead.position, axis=X))
    solution = ts.simulate(scene, (0.0, 1.0)).raise_if_failed()
    np.testing.assert_allclose(solution.position(bead)[-1], (1.1, 0.2, 0.3), atol=HELD)
    np.testing.assert_allclose(solution.reaction(line)[0][-1], (0.0, 0.0, 9.81), atol=HELD)


def test_fixed_at_takes_the_bodies_as_they_stand(rng):
    scene, rod, arm = posed(rng)
    joint = scene.add(C.Fixed.at(rod, arm))
    np.testing.assert_array_equal(joint.point_b, (0, 0, 0))  # the centroid of b
    assert np.abs(residuals(scene)).max() < 20 * EPS
    np.testing.assert_array_equal(C.Fixed.at(rod, scene.ground).point_a, (0, 0, 0))
    np.testing.assert_array_equal(C.Fixed.at(rod, arm, point=rod.position).point_a, (0, 0, 0))


def test_a_scene_that_can_not_move_stands_still():
    """No degree of freedom is left; the weight is carried."""
    scene, rod, _ = build()
    scene = ts.Scene()
    rod = scene.add_body(2.0, (1, 1, 1), position=(1.0, 0.0, 0.0))
    joint = scene.add(C.Fixed.at(scene.ground, rod, point=(0, 0, 0)))
    for options in ({}, {"integrator": "dop853", "formulation": "null-space"}):
        solution = ts.simulate(scene, (0.0, 1.0), **options).raise_if_failed()
        force, torque = solution.reaction(joint)
        np.testing.assert_allclose(force[-1], (0, 0, 2.0 * 9.81), atol=HELD)
        np.testing.assert_allclose(torque[-1], (0, -2.0 * 9.81, 0), atol=HELD)


@pytest.mark.parametrize("kind", ["Translational", "Fixed"])
def test_references_that_are_given_say_the_angle(kind):
    """b is a quarter turn about x from a; without references that is what stays, with them it is what they say."""
    _, rod, arm = build()
    arm.orientation = (np.cos(np.pi / 4), np.sin(np.pi / 4), 0, 0)
    points = {"point_a": (1, 0, 0), "point_b": (-1, 0, 0)}
    axes = {"axis_a": X, "axis_b": X}
    left_out = getattr(C, kind)(rod, arm, **points, **axes)
    in_ground = body_matrix(arm) @ left_out.reference_b
    np.testing.assert_allclose(in_ground, left_out.reference_a, atol=4 * EPS)
    for references in ({"reference_a": Y, "reference_b": -Z}, {"reference_a": (5, 2, 0)}, {"reference_b": (1, 1, 0)}):
        scene, rod, arm = build()
        arm.orientation = (np.cos(np.pi / 4), np.sin(np.pi / 4), 0, 0)
        scene.add(getattr(C, kind)(rod, arm, **points, **axes, **references))
        assert np.abs(residuals(scene)).max() < 4 * EPS
    joint = scene.add(getattr(C, kind)(rod, arm, **points, **axes, reference_a=Y, reference_b=Y, name="other"))
    turn = scene.row_names().index(f"{kind} 'other' turn")
    assert abs(residuals(scene)[turn]) == pytest.approx(1.0)
    assert joint.rows == (5 if kind == "Translational" else 6)


def test_axes_that_are_not_yet_aligned_keep_the_angle_about_them(rng):
    """A sketch: the references follow from the bodies turned by the least that brings the axes together."""
    scene, rod, arm = build()
    arm.orientation = Rotation.from_rotvec((0.0, 0.2, 0.1))
    joint = scene.add(C.Fixed(rod, arm, point_a=(1, 0, 0), point_b=(-1, 0, 0), axis_a=X, axis_b=X))
    scene.assemble()
    np.testing.assert_allclose(body_matrix(arm), body_matrix(rod), atol=HELD)
    assert joint.reference_b @ joint.axis_b == pytest.approx(joint.reference_a @ joint.axis_a, abs=EXACT)


def test_the_second_arm_of_a_universal_joint_is_across_its_shaft():
    scene, rod, arm = build()
    arm.position = (2.0 + np.cos(0.5), np.sin(0.5), 0.0)
    joint = C.Universal.at(rod, arm, point=(2, 0, 0), axis=Z)
    np.testing.assert_allclose(joint.axis_b, (-np.sin(0.5), np.cos(0.5), 0.0), atol=4 * EPS)
    named = C.Universal.at(rod, arm, point=(2, 0, 0), axis_a=Z, axis_b=X)
    np.testing.assert_allclose((named.axis_a, named.axis_b), (Z, X), atol=4 * EPS)
    np.testing.assert_allclose(C.Universal.at(rod, scene.ground, point=(0, 0, 0), axis=Z).axis_b, Y, atol=4 * EPS)
    with pytest.raises(ts.InvalidConstraint, match="give axis_b"):
        C.Universal.at(rod, arm, point=arm.position, axis=Z)
    with pytest.raises(ts.InvalidConstraint, match="give axis_b"):
        C.Universal.at(rod, arm, point=(2, 0, 0), axis=arm.position - (2, 0, 0))


def test_an_angle_that_is_left_out_is_that_of_the_bodies(rng):
    _, rod, arm = posed(rng)
    u, v = rng.normal(size=(2, 3))
    joint = C.ConstantAngle.at(rod, arm, axis_a=u, axis_b=v)
    assert joint.angle == pytest.approx(np.arccos(u @ v / np.linalg.norm(u) / np.linalg.norm(v)), rel=HELD)
    assert C.ConstantAngle(rod, arm, axis_a=X, axis_b=X, angle=1.0).parts[0].value == np.cos(1.0)
