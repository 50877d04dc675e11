"""Every primitive against complex steps of its phi; the checker against primitives with one entry broken."""

import math

import numpy as np
import pytest

import tsdyn as ts
from examples.bead_on_surface import OnEllipsoid
from examples.driven_pivot import DrivenPivot
from tests.helpers.built_in import FORCES, JOINTS, PRIMITIVES
from tests.helpers.tolerances import ALGEBRA
from tsdyn.jit.kernels import twin
from tsdyn.testing.series_checks import check_constraint_series

C = ts.constraints
WAVE = (
    lambda t: 0.5 + 0.3 * np.sin(2.0 * t),
    lambda t: 0.6 * np.cos(2.0 * t),
    lambda t: -1.2 * np.sin(2.0 * t),
)
RHEONOMIC = {
    "Distance": lambda a, b: C.Distance(a, b, point_a=(1, 2, 3), point_b=(0.3, 0.2, 1), length=WAVE),
    "Dot1": lambda a, b: C.Dot1(a, b, axis_a=(1, 2, 3), axis_b=(0.3, 0.2, 1), value=WAVE),
    "Dot2": lambda a, b: C.Dot2(a, b, axis_a=(1, 2, 3), point_a=(0, 1, 0), point_b=(0.3, 0.2, 1), value=WAVE),
}
DRIVEN = {
    "Distance": lambda a, b, f: C.Distance(a, b, point_a=(1, 2, 3), point_b=(0.3, 0.2, 1), length=f),
    "Dot1": lambda a, b, f: C.Dot1(a, b, axis_a=(1, 2, 3), axis_b=(0.3, 0.2, 1), value=f),
    "Dot2": lambda a, b, f: C.Dot2(a, b, axis_a=(1, 2, 3), point_a=(0, 1, 0), point_b=(0.3, 0.2, 1), value=f),
    "AngleDriver": lambda a, b, f: C.AngleDriver(
        a, b, reference_a=(1, 2, 3), across_a=(0, 1, 1), reference_b=(2, 0, 1), angle=f
    ),
    "RotationMotor": lambda a, b, f: C.RotationMotor(a, b, axis_a=(1, 2, 3), axis_b=(0.3, 0.2, 1), angle=f),
    "TranslationMotor": lambda a, b, f: C.TranslationMotor(a, b, axis_a=(1, 2, 3), point_b=(0, 1, 2), displacement=f),
    "PointDriver": lambda a, b, f: C.PointDriver(a, b, point_a=(0, 1, 0), point_b=(1, 0, 2), path=(f, 0.3, f)),
}
GIVEN = {
    "motion": 0.5 + 0.3 * np.sin(2.0 * ts.motions.time) * ts.motions.Exponential(1.0, -0.3),
    "function": lambda t: 0.5 + 0.3 * np.sin(2.0 * t) * np.exp(-0.3 * t),
    "three functions": WAVE,
}


def test_every_primitive_and_joint_is_public():
    assert {kind.__name__ for kind in PRIMITIVES + JOINTS} <= set(C.__all__)


@pytest.mark.parametrize("kind", [*PRIMITIVES, *JOINTS, *FORCES], ids=lambda kind: kind.__name__)
def test_a_new_one_is_checked_once(kind, monkeypatch, rng):
    scene, asked, plain = ts.Scene(), [], kind.check
    a, b = (scene.add_body(1.0, (1, 1, 1), position=(x, 0, 0)) for x in (0, 1))
    monkeypatch.setattr(kind, "check", lambda self: asked.append(self) or plain(self))
    one = kind.example(rng, a, b)
    assert asked == [one]


@pytest.mark.slow_but("0-*", "!0-OnEllipsoid", "!0-DrivenPivot")
@pytest.mark.parametrize("kind", [*PRIMITIVES, OnEllipsoid, DrivenPivot], ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("seed", range(3))
def test_kernels_are_the_derivatives_of_phi(kind, seed):
    ts.testing.check_primitive(kind, seed=seed)


@pytest.mark.parametrize("make", RHEONOMIC.values(), ids=RHEONOMIC.keys())
def test_kernels_with_a_motion(make):
    ts.testing.check_primitive(make)


@pytest.mark.slow_but("*-motion")
@pytest.mark.parametrize("given", GIVEN.values(), ids=GIVEN)
@pytest.mark.parametrize("make", DRIVEN.values(), ids=DRIVEN)
def test_kernels_and_series_of_what_is_driven(make, given):
    """phi, jacobian, phi_t and gamma; of a motion the coefficients of Phi_x, Phi_t and Phi, too."""
    ts.testing.check_primitive(lambda a, b: make(a, b, given), states=2)


@pytest.mark.parametrize("kind", [C.Distance, C.Dot1, C.Dot2, C.AngleDriver], ids=lambda kind: kind.__name__)
def test_checker_names_a_broken_series_of_phi_t(kind):
    good = kind.series_t

    def spoil(x, par, k, s, out):
        good(x, par, k, s, out)
        if k == 3:
            out[0] += 1e-6

    Broken = type(kind.__name__, (kind,), {"series_t": staticmethod(spoil)})
    scene, rng = ts.Scene(), np.random.default_rng(2)
    a, b = (scene.add_body(1.0, (1, 1, 1), position=rng.normal(size=3), orientation=unit(rng)) for _ in range(2))
    constraint = DRIVEN[kind.__name__](a, b, GIVEN["motion"])
    constraint.__class__ = Broken
    with pytest.raises(ts.testing.CheckFailed, match=r"coefficient 3 of phi_t\[0\]"):
        check_constraint_series(scene, constraint, "it", rng)


def broken(kind, name, entry):
    """The primitive with one entry of one kernel off by a thousandth."""
    good = twin(getattr(kind, name))  # in Python, with the kernels that it calls

    def spoil(*arguments):
        good(*arguments)
        arguments[-1][entry] += 1e-3

    def three(x, par, t, out):
        spoil(x, par, t, out)

    def four(x, xd, par, t, out):
        spoil(x, xd, par, t, out)

    return type("Broken", (kind,), {name: staticmethod(four if "gamma" in name else three)})


def entries(kind):
    size = sum(marker.size for marker in kind.markers)
    for row in range(kind.rows):
        yield kind, "gamma", row
        if getattr(kind, "phi_t", None):
            yield kind, "phi_t", row
        for column in range(size):
            yield kind, "jacobian", (row, column)
    for row in range(kind.rate_rows):
        yield kind, "rate_gamma", row
        for column in range(size):
            yield kind, "rate_jacobian", (row, column)


@pytest.mark.parametrize("kind", [*PRIMITIVES, DrivenPivot], ids=lambda kind: kind.__name__)
def test_checker_names_every_broken_entry(kind):
    for _, name, entry in entries(kind):
        where = ", ".join(map(str, np.atleast_1d(entry)))
        with pytest.raises(ts.testing.CheckFailed, match=rf"Broken.*{name}\[{where}\]"):
            ts.testing.check_primitive(broken(kind, name, entry))


def test_checker_sees_what_is_missing_or_not_analytic():
    class Forgot(DrivenPivot):
        phi_t = None

    class RealOnly(C.Distance):
        @staticmethod
        def phi(x, par, t, out):
            out[0] = math.sin(x[0])

    with pytest.raises(ts.testing.CheckFailed, match="no phi_t"):
        ts.testing.check_primitive(Forgot)
    with pytest.raises(ts.testing.CheckFailed, match="no comparison"):
        ts.testing.check_primitive(RealOnly)


def test_checker_accepts_instances_made_by_a_function_only():
    with pytest.raises(ts.InvalidArgument):
        ts.testing.check_primitive(3)


@pytest.mark.parametrize("kind", PRIMITIVES, ids=lambda kind: kind.__name__)
def test_moving_the_whole_scene_changes_nothing(kind):
    """Phi and its rate between two bodies depend on their relative pose and motion alone."""
    if kind is C.EulerNormalization:
        pytest.skip("a row of one body")
    rng = np.random.default_rng(5)
    scene = ts.Scene()
    bodies = [scene.add_body(1.0, (1, 1, 1), position=rng.normal(size=3), orientation=unit(rng)) for _ in range(2)]
    constraint = scene.add(kind.example(rng, *bodies))
    for body in bodies:
        body.velocity, body.angular_velocity = rng.normal(size=(2, 3))
    before, rates = levels(scene, constraint)
    turn, shift = unit(rng), rng.normal(size=3)
    for body in bodies:
        body.position = matrix(turn) @ body.position + shift
        body.orientation = product(turn, body.orientation)
        body.velocity = matrix(turn) @ body.velocity
    after, rates_after = levels(scene, constraint)
    if kind is C.Spherical:
        before, rates = matrix(turn) @ before, matrix(turn) @ rates
    np.testing.assert_allclose(after, before, atol=ALGEBRA)
    np.testing.assert_allclose(rates_after, rates, atol=ALGEBRA * (1.0 + np.abs(rates).max()))


def levels(scene, constraint):
    """Phi and Phi_q qd of a constraint; of rows on velocities Phi is zero, and the other A qd."""
    found, rows = scene.evaluate(), slice(0, constraint.all_rows)
    return found.Phi[rows], found.Phi_q[rows] @ scene.start[1]


def unit(rng):
    p = rng.normal(size=4)
    return p / np.linalg.norm(p)


def product(p, q):
    return np.concatenate(([p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])))


def matrix(p):
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(p, -1)).as_matrix()
