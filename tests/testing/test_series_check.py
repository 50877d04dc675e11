"""The checkers and `series`: right ones pass, wrong ones are named; scenes without are refused with the reason."""

import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers import built_in
from tests.helpers.plug_ins import Rod, Soft
from tsdyn.jit.kernels import twin
from tsdyn.taylor.layout import refusal, without_series
from tsdyn.testing.series_checks import check_constraint_series, check_force_series

C, F = ts.constraints, ts.forces
SMOOTH = {
    "Spring": lambda a, b: F.Spring(a, b, point_a=(1, 0.3, 0), stiffness=2.0, damping=0.7, actuator=0.4),
    "Spring, undamped": lambda a, b: F.Spring(a, b, stiffness=2.0, free_length=0.4),
    "Spring, a damper": lambda a, b: F.Spring(a, b, damping=2.0),
    "TorsionalSpring": lambda a, b: torsional(a, b, stiffness=2.0, damping=0.7, free_angle=0.4, actuator=0.3),
    "TorsionalSpring, undamped": lambda a, b: torsional(a, b, stiffness=2.0),
    "TorsionalSpring, a damper": lambda a, b: torsional(a, b, damping=2.0),
    "Bushing": lambda a, b: F.Bushing.example(np.random.default_rng(1), a, b),
    "Bushing, linear": lambda a, b: F.Bushing(a, b, stiffness=(1, 2, 3)),
    "Bushing, linear, a damper": lambda a, b: F.Bushing(a, b, point_b=(0, 1, 2), damping=(1, 2, 3)),
    "Bushing, torsional": lambda a, b: F.Bushing(a, b, torsional_stiffness=(1, 2, 3)),
    "Bushing, torsional, a damper": lambda a, b: F.Bushing(a, b, torsional_damping=(1, 2, 3)),
    "PointForce": lambda a, b: F.PointForce(a, point_a=(1, 2, 3), force=(3, 1, 2)),
    "PointForce, of the body": lambda a, b: F.PointForce(a, point_a=(1, 2, 3), force=(3, 1, 2), frame="body"),
    "Torque": lambda a, b: F.Torque(a, torque=(3, 1, 2)),
    "Torque, of the body": lambda a, b: F.Torque(a, torque=(3, 1, 2), frame="body"),
    "ViscousFriction": lambda a, b: F.ViscousFriction(a, b, point_a=(1, 2, 3), damping=0.4, torsional_damping=0.3),
    "ViscousFriction, of the turning": lambda a, b: F.ViscousFriction(a, b, torsional_damping=0.3),
}


def torsional(a, b, **numbers):
    return F.TorsionalSpring(a, b, axis_a=(0, 0.2, 1), reference_a=(1, 0, 0), reference_b=(0.2, 1, 0.3), **numbers)


@pytest.mark.slow_but("Spring*")
@pytest.mark.parametrize("make", SMOOTH.values(), ids=SMOOTH.keys())
def test_series_of_forces(make):
    ts.testing.check_force(make, states=1)


@pytest.mark.slow
def test_series_of_plug_ins():
    ts.testing.check_force(Soft)
    ts.testing.check_primitive(Rod)


@pytest.mark.slow
def test_the_example_of_the_docs(tmp_path, monkeypatch):
    text = (Path(__file__).parents[2] / "docs" / "plug-ins.md").read_text().split("# Taylor series of your own")[1]
    (tmp_path / "series_of_the_docs.py").write_text(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1])
    monkeypatch.syspath_prepend(tmp_path)
    import_module("series_of_the_docs")  # it checks itself


def test_every_smooth_kind_has_a_series():
    """What has none says why."""
    for kind in built_in.PRIMITIVES + built_in.FORCES:
        if not getattr(kind, "normalises", False):
            assert getattr(kind, "series", None) or kind.no_series, kind


# what is wrong is named


def broken(kind):
    """The kind with what `series` gives off by a part in a million at the entry and order of a list."""
    good, place = twin(kind.series), []

    def constraint(x, par, k, s, out):
        good(x, par, k, s, out)
        if k == place[1]:
            out[place[0]] += 1e-6

    def force(x, xd, par, k, s, out):
        good(x, xd, par, k, s, out)
        if k == place[1]:
            out[place[0]] += 1e-6

    chosen = constraint if issubclass(kind, ts.Primitive) else force
    return type("Broken", (kind,), {"series": staticmethod(chosen)}), place


def pair():
    rng = np.random.default_rng(3)
    scene = ts.Scene()
    for _ in range(2):
        p = rng.normal(size=4)
        scene.add_body(1.0, (1, 1, 1), position=rng.normal(size=3), orientation=p / np.linalg.norm(p))
    return scene, *scene.bodies, rng


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", [C.Spherical, C.Distance, C.Dot1, C.Dot2, C.PlaneContact, C.AngleDriver, C.Thread, C.Gear, Rod]
)
def test_checker_names_the_coefficient_of_a_constraint(kind):
    wrong, place = broken(kind)
    scene, a, b, rng = pair()
    constraint = scene.add(wrong.example(rng, a, b))
    for j in range(3 * len(kind.markers)):
        for k in (0, 1, 7):
            place[:] = (0, j), k
            with pytest.raises(ts.testing.CheckFailed, match=rf"series: coefficient {k} of jacobian\[0, {j}\]"):
                check_constraint_series(scene, constraint, "Broken", rng)


@pytest.mark.slow_but("Spring")
@pytest.mark.parametrize(
    "kind", [F.Spring, F.TorsionalSpring, F.Bushing, F.ViscousFriction, F.PointForce, F.Torque, Soft]
)
def test_checker_names_the_coefficient_of_a_force(kind):
    wrong, place = broken(kind)
    scene, a, b, rng = pair()
    force = scene.add(wrong.example(rng, a, b))
    for j in range(sum(m.size for m in kind.markers)):
        for k in (0, 1, 7):
            place[:] = j, k
            with pytest.raises(ts.testing.CheckFailed, match=rf"series: coefficient {k} of out\[{j}\]"):
                check_force_series(scene, force, "Broken", rng)


@pytest.mark.slow
def test_checkers_run_the_series():
    class Flat(Rod):
        @staticmethod
        def series(x, par, k, s, out):
            pass

    class Still(Soft):
        @staticmethod
        def series(x, xd, par, k, s, out):
            pass

    with pytest.raises(
        ts.testing.CheckFailed, match=r"Flat .*coefficient 0 of jacobian\[0, 0\] .*point_a, component x"
    ):
        ts.testing.check_primitive(Flat)
    with pytest.raises(ts.testing.CheckFailed, match=r"Still .*coefficient 0 of out\[0\] .*point_a, component x"):
        ts.testing.check_force(Still)


@pytest.mark.slow
def test_checker_sees_scratch_memory_that_is_too_small_or_read_too_early():
    class Short(Soft):
        slots = 16

    class Early(Rod):
        @staticmethod
        def series(x, par, k, s, out):
            out[0, 0] = s[0, k]

    scene, a, b, rng = pair()
    short = scene.add(Short.example(rng, a, b))
    with pytest.raises(ts.testing.CheckFailed, match="slots = 16"):
        check_force_series(scene, short, "Short", rng)
    scene, a, b, rng = pair()
    early = scene.add(Early.example(rng, a, b))
    with pytest.raises(ts.testing.CheckFailed, match=r"jacobian\[0, 0\] .* is nan"):
        check_constraint_series(scene, early, "Early", rng)


@pytest.mark.slow
def test_checker_sees_a_law_that_depends_on_time():
    class Timed(Soft):
        series = staticmethod(Soft.series)

        @staticmethod
        def law(x, xd, par, t, out):
            for i in range(10):
                out[i] = -np.exp(-0.3 * (x[0] * x[0] + x[1] * x[1])) / (2.0 + x[2] * x[2]) * xd[i] + np.sin(t)

    scene, a, b, rng = pair()
    timed = scene.add(Timed.example(rng, a, b))
    with pytest.raises(ts.testing.CheckFailed, match=r"coefficient 0 of out\[0\]"):
        check_force_series(scene, timed, "Timed", rng)


@pytest.mark.parametrize(("base", "members", "message"), [
    (Rod, {"slots": 1.5}, "slots must be"),
    (Soft, {"slots": -1}, "slots must be"),
    (Rod, {"series": staticmethod(lambda x, k, s, out: None)}, "series as a static method with 5 arguments"),
    (Rod, {"markers": (ts.Parameters("a"), ts.Point("b"))}, "Points and Vectors only"),
])  # fmt: skip
def test_wrong_classes_are_refused(base, members, message):
    with pytest.raises((ts.InvalidConstraint, ts.InvalidForce), match=message):
        type("Wrong", (base,), members)


# scenes that have none


def switched(t):
    return 1.0 if t < 0.5 else 2.0


WAVE = (switched, lambda t: 0.0, lambda t: 0.0)


class NoSeries(Rod):
    series = None


class NoForceSeries(Soft):
    series = None


def drag(t, a, b, par, out):
    if a[7] > 0.0:
        out[0] = -a[7]


def follow(t, state):
    return abs(state[0]), 0.0, 0.0


class DoubleFriction(F.ContactFriction):
    """Whose law is another than that of the series."""

    @staticmethod
    def normal_load(x, f, par):
        return par[4] + 2.0 * np.sqrt(f[2] * f[2])


def rub(a, b, name):
    return DoubleFriction(a.scene.add(C.PlaneContact(a, b, normal_b=(0, 0, 1))), kinetic=0.1, name=name)


REFUSED = {
    "a function of time": (
        lambda a, b: F.Spring(a, b, actuator=switched, name="left"),
        "Spring 'left': its actuator is a function of time that can't be traced, it compares values",
    ),
    "of state": (lambda a, b: F.PointForce(a, force=follow), r"PointForce\(body1\): its force is .* absolute value"),
    "user": (lambda a, b: F.UserForce(a, b, function=drag, name="u"), "UserForce 'u': its function .* compares values"),
    "friction": (
        lambda a, b: rub(a, b, "rub"),
        "DoubleFriction 'rub': DoubleFriction has no kernel `series` and `normal_series`",
    ),
    "plug-in force": (
        lambda a, b: NoForceSeries(a, name="f"),
        "NoForceSeries 'f': NoForceSeries has no kernel `series`",
    ),
    "plug-in": (lambda a, b: NoSeries(a, b, name="r"), "NoSeries 'r': NoSeries has no kernel `series`"),
    "driven": (lambda a, b: C.Distance(a, b, length=WAVE, name="d"), "Distance 'd': its length is a function of time"),
}


@pytest.mark.slow_for("of state", "plug-in", "user", "plug-in force")
@pytest.mark.parametrize(("make", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_scenes_without_series_are_refused_by_name(make, message):
    scene, a, b, _ = pair()
    scene.add(make(a, b))
    said = refusal(scene.packed)
    assert re.search(message, said)
    assert "DOP853" in said
    scene.add(rub(b, scene.ground, "brake"))
    assert len(without_series(scene.packed)) == 2


def test_taylor_refuses_and_the_default_method_does_without():
    scene, a, b, _ = pair()
    scene.add(F.Spring(a, b, actuator=switched, name="left"))
    with pytest.raises(ts.InvalidArgument, match="Spring 'left': its actuator is a function of time"):
        ts.simulate(scene, (0.0, 0.1), integrator=ts.integrators.Taylor())
    assert ts.simulate(scene, (0.0, 0.1)).success


def test_scenes_with_series_are_not_refused():
    scene, a, b, rng = pair()
    for make in SMOOTH.values():
        scene.add(make(a, b))
    for kind in (C.Spherical, C.Distance, C.Dot1, C.Dot2, C.PlaneContact, Rod):
        scene.add(kind.example(rng, a, b))
    assert without_series(scene.packed) == []
    assert refusal(scene.packed) == ""
