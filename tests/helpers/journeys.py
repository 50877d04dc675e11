"""Journeys: every public name of a result, called as a user would, with what must hold of any of them."""

import copy
import inspect
import pickle
from html.parser import HTMLParser
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib import pyplot

import tsdyn as ts

VOID = {"br", "hr", "img", "input", "meta", "link", "path", "circle", "rect", "line", "polyline", "use"}


class Balanced(HTMLParser):
    """Raises where a tag is left open or closed twice."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag


def displayed(thing):
    """What print and a notebook show of a result; neither is empty, a default or broken."""
    for text in (str(thing), repr(thing), format(thing)):
        assert text.strip()
        assert " object at 0x" not in text
    if hasattr(thing, "_repr_html_"):
        Balanced(thing._repr_html_())


def public(kind):
    """The public names of a class, but those of a plain tuple and other ways to make one."""
    names = (name for name in dir(kind) if not name.startswith("_") and name not in dir(tuple))
    return sorted(name for name in names if not isinstance(inspect.getattr_static(kind, name), classmethod))


def finite(value, where):
    """No NaN in what isn't documented to have one; packed numbers of loads are NaN until a time is set."""
    if where == "packed":
        return
    for array in value if isinstance(value, (tuple, list)) else [value]:
        if isinstance(array, np.ndarray) and array.dtype.kind == "f":
            assert np.isfinite(array).all(), where
        elif isinstance(array, tuple):
            finite(array, where)


def rigid(body):
    return body.dimension == 7


class Tour:
    """Visits a Solution or a State of a scene; `k` is the leading shape of its arrays."""

    def __init__(self, scene, kinematics, leading):
        self.scene, self.on, self.leading = scene, kinematics, leading

    def everything(self):
        """Visit each public name; one that this tour doesn't know fails it."""
        for name in public(type(self.on)):
            value = getattr(type(self.on), name, None)
            if callable(value):
                getattr(self, name)()
            else:
                self.attribute(name)

    def attribute(self, name):
        """An attribute: what it needs is said where it isn't there."""
        needs_dense = name == "work" and self.on._trajectory is None
        needs_history = name in ("steps", "charts") and self.on._step_log is None
        if needs_dense or needs_history:
            with_message(ts.InvalidArgument, lambda: getattr(self.on, name))
            return
        value = getattr(self.on, name)
        if name not in ("multipliers", "state", "steps", "charts"):  # NaN for redundant rows; a state has a tour
            finite(value, name)

    def shape(self, value, *shape):
        assert np.shape(value) == (*self.leading, *shape)
        assert np.isfinite(value).all()

    def _of_bodies(self, method, size, bodies, points=False):
        for body in bodies:
            self.shape(method(body), *size)
            np.testing.assert_array_equal(method(body.name), method(body))
            if points and rigid(body):
                self.shape(method(body, point=(0.1, 0.2, 0.3)), *size)

    def position(self):
        self._of_bodies(self.on.position, (3,), self.scene.bodies, True)

    def velocity(self):
        self._of_bodies(self.on.velocity, (3,), self.scene.bodies, True)

    def acceleration(self):
        self._of_bodies(self.on.acceleration, (3,), self.scene.bodies, True)

    def orientation(self):
        self._of_bodies(self.on.orientation, (4,), filter(rigid, self.scene.bodies))

    def rotation(self):
        self._of_bodies(self.on.rotation, (3, 3), filter(rigid, self.scene.bodies))

    def angular_velocity(self):
        self._of_bodies(self.on.angular_velocity, (3,), filter(rigid, self.scene.bodies))

    def angular_acceleration(self):
        self._of_bodies(self.on.angular_acceleration, (3,), filter(rigid, self.scene.bodies))

    def _of_joints(self, method, kind):
        for item in self.items():
            try:
                value = method(item)
            except ts.InvalidConstraint as error:
                assert f"has no {kind}" in str(error)  # noqa: PT017
            else:
                assert np.shape(value)[: len(self.leading)] == self.leading
                assert np.isfinite(value).all()
                np.testing.assert_array_equal(method(item.name), value)

    def items(self):
        return [*self.scene.constraints, *self.scene.forces]

    def angle(self):
        self._of_joints(self.on.angle, "angle")

    def angle_rate(self):
        self._of_joints(self.on.angle_rate, "angle")

    def angle_acceleration(self):
        self._of_joints(self.on.angle_acceleration, "angle")

    def displacement(self):
        self._of_joints(self.on.displacement, "displacement")

    def displacement_rate(self):
        self._of_joints(self.on.displacement_rate, "displacement")

    def displacement_acceleration(self):
        self._of_joints(self.on.displacement_acceleration, "displacement")

    # of a Solution alone

    def reaction(self):
        for item in self.items():
            if not hasattr(item, "on"):
                continue
            for value in self.on.reaction(item):
                self.shape(value, 3)

    def contact_point(self):
        self._of_contacts(self.on.contact_point, (3,))

    def friction_demand(self):
        self._of_contacts(self.on.friction_demand, ())

    def sticking(self):
        for item in self.items():
            if getattr(item, "slides", ()) or (getattr(item, "unilateral", False) and item.has_friction):
                assert self.on.sticking(item).shape == self.leading
            else:
                with_message(ts.InvalidForce, lambda item=item: self.on.sticking(item))

    def _of_contacts(self, method, size):
        for item in self.items():
            if "Rolling" in type(item).__name__:
                self.shape(method(item), *size)
            else:
                with_message(ts.InvalidConstraint, lambda item=item: method(item))

    def actuation(self):
        for item in self.items():
            with_message(ts.InvalidForce, lambda item=item: self.on.actuation(item))

    def reaction_unique(self):
        for item in self.items():
            if hasattr(item, "on"):
                unique = self.on.reaction_unique(item)
                assert unique.dtype == bool
                self.shape(unique)

    def power_of(self):
        for item in self.items():
            self.shape(self.on.power_of(item))

    def work_of(self):
        for item in self.items():
            if self.on._trajectory is None:
                with_message(ts.InvalidArgument, lambda item=item: self.on.work_of(item))
            else:
                self.shape(self.on.work_of(item))

    def rows(self):
        columns = np.zeros(self.on.multipliers.shape[1], int)
        for item in self.scene.constraints:
            columns[self.on.rows(item)] += 1
        assert columns.max(initial=0) <= 1

    def raise_if_failed(self):
        assert self.on.raise_if_failed() is self.on

    def plot(self):
        axes = self.on.plot()
        assert axes.shape == (2, 2)
        pyplot.close(axes[0, 0].figure)
        for ax in self.on.plot(self.names()):
            assert ax.lines
        pyplot.close(ax.figure)

    def names(self):
        return [thing.name for thing in (*self.scene.bodies, *self.items()) if not getattr(thing, "normalises", False)]

    def view(self):
        with TemporaryDirectory() as folder:
            assert self.on.view(f"{folder}/run.html").stat().st_size > 0
            assert self.scene.view(f"{folder}/start.html").stat().st_size > 0

    def save(self):
        with TemporaryDirectory() as folder:
            again = ts.load(self.on.save(f"{folder}/run.h5"), self.scene)
            np.testing.assert_array_equal(again.q, self.on.q)

    def to_xarray(self):
        assert self.on.to_xarray()["q"].shape == self.on.q.shape

    def to_dataframe(self):
        assert len(self.on.to_dataframe()) == len(self.on.t)
        self.shape(self.on.to_dataframe(self.names()).to_numpy().T[0])

    def to_csv(self):
        with TemporaryDirectory() as folder:
            for names in (None, self.names()):
                lines = self.on.to_csv(f"{folder}/run.csv", names).read_text().splitlines()
                assert len(lines) == 1 + len(self.on.t)
                assert lines[0].startswith("time (s),")

    def at(self):
        times = np.linspace(self.on.t[0], self.on.reached, 3)
        if self.on._trajectory is None:
            with_message(ts.InvalidArgument, lambda: self.on.at(times))
            return
        displayed(self.on.at(float(times[1])))
        Tour(self.scene, self.on.at(times), (3,)).everything()
        Tour(self.scene, self.on.at(float(times[1])), ()).everything()


def with_message(error, call):
    try:
        call()
    except error as caught:
        assert str(caught).strip()  # noqa: PT017
    else:
        raise AssertionError("nothing was raised")


def visit(scene, solution):
    """Visit everything that a run of a scene hands back."""
    for thing in (solution, solution.state, solution.status):
        displayed(thing)
    Tour(scene, solution, solution.t.shape).everything()
    Tour(scene, solution.state, ()).everything()
    for again in (pickle.loads(pickle.dumps(solution)), copy.deepcopy(solution)):
        displayed(again)
        for name in ("t", "q", "qd", "qdd", "energy", "multipliers"):
            np.testing.assert_array_equal(getattr(again, name), getattr(solution, name))
