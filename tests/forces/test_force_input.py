"""Every impossible force is refused at once, and the message says what and how to mend it."""

import json

import numpy as np
import pytest

import tsdyn as ts

F = ts.forces


class World:
    def __init__(self):
        self.scene = ts.Scene()
        self.ground = self.scene.ground
        self.a, self.b = (self.scene.add_body(1, (1, 1, 1), (i, 0, 0), name=n) for i, n in enumerate("ab"))
        self.dot = self.scene.add_point_mass(1, (0, 3, 0), name="dot")
        self.stranger = ts.Scene().add_body(1, (1, 1, 1), name="stranger")


def unlike(t, state, more):
    return 1.0


AXES = {"axis_a": (0, 0, 1), "reference_a": (1, 0, 0), "reference_b": (1, 0, 0)}
CASES = {
    "nothing in a spring": (lambda w: F.Spring(w.a, w.b), "stiffness or damping or actuator"),
    "negative stiffness": (lambda w: F.Spring(w.a, w.b, stiffness=-1), "stiffness must be .* not negative"),
    "NaN damping": (lambda w: F.Spring(w.a, w.b, damping=np.nan), "damping must be"),
    "free length of text": (lambda w: F.Spring(w.a, w.b, stiffness=1, free_length="1"), "free_length must be"),
    "actuator of two": (lambda w: F.Spring(w.a, w.b, actuator=(1, 2)), "actuator must be a finite number, a function"),
    "actuator of state": (lambda w: F.Spring(w.a, w.b, actuator=lambda t, s: 1.0), "one argument, the time"),
    "points coincide": (lambda w: F.Spring(w.a, w.b, point_a=(1, 0, 0), stiffness=1), "coincide at the start"),
    "itself": (lambda w: F.Spring(w.a, w.a, stiffness=1), "to itself"),
    "ground twice": (lambda w: F.Spring(w.ground, w.ground, stiffness=1), "must not be the ground"),
    "two scenes": (lambda w: F.Spring(w.a, w.stranger, stiffness=1), "different scenes"),
    "no body": (lambda w: F.Spring(w.a, 3, stiffness=1), "is not a body"),
    "name of no body": (lambda w: F.Spring(w.a, "c", stiffness=1), "no body is named 'c'"),
    "point of two": (lambda w: F.Spring(w.a, w.b, point_a=(1, 2), stiffness=1), "point_a must be three"),
    "point on a dot": (lambda w: F.PointForce(w.dot, point_a=(1, 0, 0), force=(1, 0, 0)), "point mass 'dot'"),
    "nothing in a torsional spring": (lambda w: F.TorsionalSpring(w.a, w.b, **AXES), "stiffness or damping"),
    "zero axis": (lambda w: F.TorsionalSpring(w.a, w.b, **AXES | {"axis_a": (0, 0, 0)}, stiffness=1), "length zero"),
    "reference along the axis": (
        lambda w: F.TorsionalSpring(w.a, w.b, **AXES | {"reference_a": (0, 0, 2)}, stiffness=1),
        "reference_a is parallel",
    ),
    "other reference along the axis": (
        lambda w: F.TorsionalSpring(w.a, w.b, **AXES | {"reference_b": (0, 0, 2)}, stiffness=1),
        "reference_b is parallel",
    ),
    "free angle of text": (lambda w: F.TorsionalSpring(w.a, w.b, **AXES, free_angle="x"), "free_angle must be"),
    "nothing in a bushing": (lambda w: F.Bushing(w.a, w.b), "torsional_stiffness or torsional_damping"),
    "bushing of two": (lambda w: F.Bushing(w.a, w.b, stiffness=(1, 2)), "a number or three numbers"),
    "negative bushing": (lambda w: F.Bushing(w.a, w.b, damping=(1, -2, 1)), "not negative"),
    "parameters of text": (
        lambda w: F.UserForce(w.a, function=five, parameters="abc"),
        "parameters must be a list of finite numbers, got 'abc'",
    ),
    "one parameter": (lambda w: F.UserForce(w.a, function=five, parameters=5.0), "parameters must be a list"),
    "no force": (lambda w: F.PointForce(w.a), "no force given"),
    "force of two": (lambda w: F.PointForce(w.a, force=(1, 2)), "force must be three finite numbers"),
    "force on the ground": (lambda w: F.PointForce(w.ground, force=(1, 0, 0)), "must not be the ground"),
    "unknown frame": (lambda w: F.PointForce(w.a, force=(1, 0, 0), frame="world"), "frame must be"),
    "function of three": (lambda w: F.PointForce(w.a, force=unlike), "one argument"),
    "function of the wrong width": (lambda w: F.PointForce(w.a, force=lambda t: 1.0), "must return three numbers"),
    "function that is not finite": (lambda w: F.PointForce(w.a, force=lambda t: (np.nan, 0, 0)), "not finite at t = 0"),
    "function that fails": (lambda w: F.PointForce(w.a, force=lambda t: (1 / t, 0, 0)), "can't be evaluated"),
    "table of numbers": (lambda w: F.PointForce(w.a, force=ts.Table([0, 1], [1, 2])), "must have 3"),
    "no torque": (lambda w: F.Torque(w.a), "no torque given"),
    "nothing in friction": (lambda w: F.ViscousFriction(w.a, w.b), "damping or torsional_damping"),
    "friction on a dot": (lambda w: F.ViscousFriction(w.a, w.dot, damping=1), "point mass 'dot'.*other body b"),
    "friction torque on a dot": (
        lambda w: F.ViscousFriction(w.dot, w.a, damping=1, torsional_damping=1),
        "set torsional_damping=0",
    ),
    "nothing in Coulomb friction": (lambda w: F.CoulombFriction(w.a, w.b), "force or torque"),
    "negative slip velocity": (
        lambda w: F.CoulombFriction(w.a, w.b, force=1, slip_velocity=-1),
        "slip_velocity must be",
    ),
    "user function of three": (lambda w: F.UserForce(w.a, function=lambda t, a, out: None), "five arguments"),
    "user parameters of text": (lambda w: F.UserForce(w.a, function=five, parameters="x"), "finite numbers"),
    "force of nothing": (lambda w: ts.Force(w.a), "base of forces"),
    "user force on nothing": (lambda w: F.UserForce(None, function=five), "is not a body"),
}


def five(t, a, b, par, out):
    out[0] = 1.0


@pytest.mark.parametrize(("make", "message"), CASES.values(), ids=CASES.keys())
def test_impossible_forces_are_refused(make, message):
    with pytest.raises(ts.InvalidForce, match=message):
        make(World())


@pytest.mark.parametrize(
    "make",
    [
        lambda w: F.Torque(w.dot, torque=(1, 0, 0)),
        lambda w: F.PointForce(w.dot, force=(1, 0, 0), frame="body"),
        lambda w: F.Bushing(w.a, w.dot, stiffness=1),
    ],
)
def test_a_point_mass_takes_no_torque(make):
    with pytest.raises(ts.InvalidBody, match="no orientation"):
        make(World())


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0], [1], "two or more"),
        ([0, 0], [1, 2], "each after the one before"),
        ([0, np.inf], [1, 2], "finite times"),
        ([0, 1], [1, 2, 3], "2 finite numbers"),
        ([0, 1], [1, np.nan], "2 finite numbers"),
        ([0, 1], [[1, 2], [3, 4]], "vectors of three"),
    ],
)
def test_impossible_tables_are_refused(times, values, message):
    with pytest.raises(ts.InvalidArgument, match=message):
        ts.Table(times, values)


def test_scenes_refuse_what_is_not_theirs():
    w = World()
    spring = w.scene.add(F.Spring(w.a, w.b, stiffness=1))
    with pytest.raises(ts.InvalidForce, match="added to this scene before; add each force once"):
        w.scene.add(spring)
    with pytest.raises(ts.InvalidForce, match="another scene"):
        w.scene.add(F.PointForce(w.stranger, force=(1, 0, 0)))
    with pytest.raises(ts.InvalidConstraint, match="not a constraint or force"):
        w.scene.add("spring")


def test_what_numba_cannot_compile_is_refused_where_it_is_added():
    cases = {
        "a function of time": lambda w: F.PointForce(
            w.a, force=lambda t: ({1: t}[1], __import__("os").getpid(), 0.0), name="wind"
        ),
        "a function of the state": lambda w: F.PointForce(w.a, force=lambda t, state: input("x"), name="wind"),
        "a method": lambda w: F.PointForce(w.a, force=lambda t, state: (state.speed(), 0.0, 0.0), name="wind"),
        "an actuator": lambda w: F.Spring(
            w.a, w.b, stiffness=1.0, actuator=lambda t: float(json.dumps(t)), name="wind"
        ),
        "a torque": lambda w: F.Torque(w.a, torque=lambda t: (float(json.dumps(t)), 0.0, 0.0), name="wind"),
        "a law": lambda w: F.UserForce(w.a, function=lambda t, a, b, par, out: out.update(json.dumps(t)), name="wind"),
    }
    for case, make in cases.items():
        w = World()
        with pytest.raises(ts.InvalidForce, match=r"wind: .*Numba can't compile") as caught:
            w.scene.add(make(w))
        assert "\n" not in str(caught.value), case
        assert type(caught.value.__cause__).__module__.startswith("numba"), case
        assert "json" not in str(caught.value), case
        assert w.scene.forces == (), case
        w.scene.evaluate()


LAW = staticmethod(lambda x, xd, par, t, out: None)


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ({"law": LAW}, "markers"),
        ({"markers": (ts.Point("a"),)}, "write law as a static method with 5 arguments"),
        ({"markers": (ts.Point("a"),), "law": staticmethod(lambda x: None)}, "5 arguments"),
        ({"markers": (ts.Point("a"),), "law": LAW, "memory": 1}, "remember"),
        ({"markers": (ts.Point("a"),), "law": LAW, "potential": staticmethod(lambda x: 0.0)}, "potential"),
    ],
)
def test_wrong_classes_are_refused(members, message):
    with pytest.raises(ts.InvalidForce, match=message):
        type("Wrong", (ts.Force,), members)


def test_constraints_have_no_turn():
    with pytest.raises(ts.InvalidConstraint, match="Point, Vector or Parameters"):
        type("Wrong", (ts.Primitive,), {"rows": 1, "markers": (ts.Turn("a"),)})


# the checker


class Quartic(ts.Force):
    """A plug-in: a force -k |x|^2 x of a point."""

    markers = (ts.Point("a"),)

    def __init__(self, a, *, point_a=(0, 0, 0), name=""):
        super().__init__(a, None, (point_a,), name)

    @staticmethod
    def law(x, xd, par, t, out):
        r = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        for i in range(3):
            out[i] = -r * x[i]

    @staticmethod
    def potential(x, par, t):
        r = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        return r * r / 4


@pytest.mark.slow
def test_checker_accepts_a_plug_in():
    ts.testing.check_force(Quartic)
    with pytest.raises(ts.InvalidArgument):
        ts.testing.check_force(3)


@pytest.mark.slow
def test_checker_sees_what_is_wrong():
    class NoPotential(Quartic):
        potential = None

    class Kinked(Quartic):
        potential = None
        loads = ("name",)

        @staticmethod
        def law(x, xd, par, t, out):
            out[0] = abs(x[0]) * x[0]

    class Generates(Quartic):
        @staticmethod
        def dissipation(x, xd, par, t):
            return -1e3

    class Differences(Kinked):
        analytic = False

    with pytest.raises(ts.testing.CheckFailed, match="are left over"):
        ts.testing.check_force(NoPotential)
    with pytest.raises(ts.testing.CheckFailed, match="dQ"):
        ts.testing.check_force(Kinked)
    with pytest.raises(ts.testing.CheckFailed, match="dissipation"):
        ts.testing.check_force(Generates)
    ts.testing.check_force(Differences)
