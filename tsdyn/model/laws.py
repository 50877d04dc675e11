"""Laws that see the whole scene, traced or called back, and packed: their state, and what loops/laws.py runs."""

import contextlib
import ctypes
import math
import signal
import threading
from itertools import combinations
from types import BuiltinFunctionType, FunctionType

import numpy as np

from ..calls import lacking
from ..elements.bodies import Ground, PointMass
from ..elements.element import Attachment
from ..elements.force import Force
from ..elements.laws import captured
from ..elements.loops import laws as loops
from ..errors import InvalidArgument, TsdynError
from ..jit.compiled import DEBUG, table
from ..jit.interrupts import raises_here
from ..jit.kernels import twin
from ..maths import vectors
from ..motions.elementary import Smooth, constant, evaluate, ordered
from ..motions.tracing import Symbol, Untraceable, Writer, demand_near, may_change, nodes, retold, traced, tried
from ..validation import counted, number
from .handles import BodyMotion
from .handles import angle as angle_of
from .kinematics import Anchor, Kinematics

HANDLES = PointMass, Ground, Attachment, type, BuiltinFunctionType  # what names alone say all of
cross, to_body, to_ground = map(twin, (vectors.cross, vectors.to_body, vectors.to_ground))


# The state that a law gets.


class SceneState(Kinematics["float | Any"]):
    """What a law of the whole scene gets: bodies, points and joints by handle or name, as events do.

    Accelerations and reactions follow from the forces, so there are none.

    Attributes
    ----------
    t : float, s
    q, qd : ndarray (n,)
    """

    __slots__ = ("anchor", "handles", "q", "qd", "t")

    def __init__(self, handles, t, q, qd, angles):
        self.handles, self.t, self.q, self.qd, self.anchor = handles, t, q, qd, Anchor(angles)

    @property
    def _levels(self):
        return self.q, self.qd

    def _refuse(self, *given, **others):
        raise InvalidArgument("a law sees positions and velocities: accelerations and reactions follow from forces.")

    acceleration = angular_acceleration = angle_acceleration = displacement_acceleration = reaction = _refuse
    qdd = multipliers = property(_refuse)

    def __getattr__(self, name):
        raise lacking(self, name)

    def __getitem__(self, i):
        raise InvalidArgument(
            "this state is that of the scene and has no numbers by index: ask state.position(body), "
            "state.angle(joint), and so on. A function that calls no method of its state gets the array of its body."
        )


class _SymbolicState(SceneState):
    """The same of symbols; all angles are symbols of their own."""

    __slots__ = ("counted",)

    def angular_velocity(self, body):
        body = self.handles.body(body)
        body.orientation  # noqa: B018  a point mass says that it has none
        return np.array(BodyMotion(*self.handles.where(body), self._levels).turning(1))

    def _counted(self, j, geometry):
        return self.counted[j]


class _TracedState:
    """What a function gets that is traced: each result is symbols, whose meaning is noted."""

    def __init__(self, state, first):
        self._state, self._first, self.found = state, first, []

    def __getattr__(self, name):
        value = getattr(self._state, name)
        return (
            (lambda *given, **others: self._noted(value(*given, **others))) if callable(value) else self._noted(value)
        )

    def _noted(self, value):
        if not isinstance(value, np.ndarray):
            return self._symbol(value)
        out = np.empty(value.shape, object)
        for place in np.ndindex(value.shape):
            out[place] = self._symbol(value[place])
        return out

    def _symbol(self, value):
        self.found += nodes([value])
        return Symbol(_input(self._first + len(self.found) - 1))

    def __getitem__(self, i):
        return self._state[i]


def _input(i):
    return Smooth("input", (), (float(i),))


def _symbol(i):
    return Symbol(_input(i))


# A law, packed.


class Law:
    """A law of a packed scene.

    Attributes
    ----------
    why : str
        Why it is called in Python; "" for one that is traced.
    changes : bool
        Whether it may change within any part of a step.
    counted : list of int
        The angles whose turns it remembers, by their places among all.
    bodies : list of int
        The bodies that its program reads or acts on.
    values : int
        How many numbers its function gives.
    address : int
        Where in System.reals the address of its callback is; -1 for none.
    """

    def __init__(self, force, handles):
        self.force, self.handles, self.actions = force, handles, force.actions()
        self.values, self.numbers = len(self.actions), force.parameters()
        self.held, self.why, self.changes, self.address = force.period is not None, "", False, -1
        self._callback = None
        places = [handles.where(body) for body in handles.bodies]
        self._n = sum(dimension for _, dimension in places)
        # Provisional inputs: t, values, numbers, angles, q, qd
        ends = np.cumsum([1, self.values, len(self.numbers), handles.count, self._n])
        value, own, angle, q, qd = (int(end) for end in ends)
        arrays = [np.array([_symbol(first + i) for i in range(self._n)], object) for first in (q, qd)]
        state = _SymbolicState(handles, _symbol(0), *arrays, None)
        state.counted = [_symbol(angle + j) for j in range(handles.count)]
        self._inputs = value, own, angle, q, qd
        given = None if self.held else self._trace(state, own)
        self.traced = given is not None
        symbols = [_symbol(1 + i) for i in range(self.values)] if given is None else [Symbol(node) for node in given]
        self._find_program(state, symbols, places)

    def state(self, t, q, qd, angles):
        """The `SceneState`; angles: all, correct to half a turn."""
        return SceneState(self.handles, t, q, qd, angles)

    def evaluate(self, t, q, qd, angles, numbers):
        """The values of the function (values,), a list, by Python; raises InvalidForce unless they are numbers."""
        force = self.force
        given = force.results(getattr(force, force.given), t, self.state(t, q, qd, angles), numbers)
        wanted = f"{force.name}: its {force.given} must give {counted(self.values, 'number')}{force.each}"
        if len(given) != self.values:
            raise force.error(f"{wanted}; it gave {len(given)}.")
        strange = [value for value in given if not isinstance(value, (int, float, np.number, np.bool_))]
        if strange:
            raise force.error(f"{wanted}; it gave {strange[0]!r}.")
        return [number(value) for value in given]

    def _trace(self, state, first):
        """The graphs of the values; None where the function is called in Python."""
        function = getattr(self.force, self.force.given)
        try:
            if not isinstance(getattr(function, "py_func", function), FunctionType):
                raise Untraceable("it is no plain function")
            count, results, plain = len(self.numbers), self.force.results, retold(function)
            seen_by(function)  # refuses what may change unseen
            seen = _TracedState(state, 1 + count)
            found = traced(lambda t, numbers: results(plain, t[0], seen, numbers), (1, count), self.values)
            means = [_input(0), *(_input(first + i) for i in range(count)), *seen.found]
            given = evaluate(found, means)
            if not all(isinstance(value, Smooth) or math.isfinite(value) for value in given):
                raise Untraceable("it gives a number that is not finite")
            graphs = [_graph(value) for value in given]
            self._demand_same(graphs)
            self.changes = may_change(Writer(found, len(means), range(1, 1 + count), 0, len(means)).numbers())
            return graphs
        except Untraceable as reason:
            self.why, self.changes = str(reason), True
            return None

    def _demand_same(self, graphs):
        """Refuse graphs whose values are not those of the function."""
        rng, numbers = np.random.default_rng(0), self.numbers
        for _ in range(2):
            t, q, qd, angles = rng.uniform(0.5, 1.5), *rng.uniform(0.5, 1.5, (2, self._n)), np.zeros(self.handles.count)
            expected = tried(self.evaluate, t, q, qd, angles, numbers)
            if expected is not None:
                turned = self.state(t, q, qd, angles).angles
                with np.errstate(all="ignore"):
                    inputs = [t, *np.zeros(self.values), *numbers, *turned, *q, *qd]
                    demand_near(evaluate(graphs, inputs), expected)

    def _find_program(self, state, values, places):
        """Forces and torques of the values, the rates of the angles that they depend on, and the program of both."""
        loads = _loads(self.actions, state, values, self.handles)
        results = nodes([part for F, N in loads.values() for part in (*F, *N)])
        _, _, angle, q, qd = self._inputs
        used = {int(node._numbers[0]) for node in ordered(results) if node._operation == "input"}
        turning = [j for j in range(self.handles.count) if angle + j in used]
        geometries = [geometry for row in self.handles.rows for geometry in row.angles]
        self._geometries = [geometries[j] for j in turning]
        # Directions between points, and angles of forces, which no joint keeps, turn at once where their lengths vanish
        loose = [row for row in self.handles.rows if isinstance(row.item, Force)]
        loose = {row.first + i for row in loose for i in range(len(row.angles))}
        self.changes |= not all(action.direction for action in self.actions) or not loose.isdisjoint(turning)
        if self.traced:
            results += nodes([_rate(state, geometry) for geometry in self._geometries])
            used |= {int(node._numbers[0]) for node in ordered(results) if node._operation == "input"}
        self.counted = [] if self.held else turning if self.traced else list(range(self.handles.count))
        if not self.traced:
            self._geometries = geometries if self.counted else []
        called, acted = not (self.traced or self.held), [self.handles.bodies.index(body) for body in loads]
        self.bodies = [
            b
            for b, (at, size) in enumerate(places)
            if called or b in acted or any(first + at + c in used for first in (q, qd) for c in range(size))
        ]
        self.acted = [acted.index(b) if b in acted else -1 for b in self.bodies]
        self.places = [places[b] for b in self.bodies]
        # Rows of the inputs: t; values, or numbers and angles; q and qd of these bodies
        inner = [1 + i for i in range(self.values)]
        if self.traced:
            inner = [self._inputs[1] + i for i in range(len(self.numbers))] + [angle + j for j in turning]
        own = [at + c for at, size in self.places for c in range(size)]
        order = [0, *inner, *(q + c for c in own), *(qd + c for c in own)]
        where = {given: _input(row) for row, given in enumerate(order)}
        found = [_graph(value) for value in evaluate(results, [where.get(i) for i in range(qd + self._n)])]
        still = range(1, 1 + (len(self.numbers) if self.traced else self.values))
        self.results, self.coordinates = len(order), len(own)
        writer = Writer(found, len(order) + len(found), still if self.traced or self.held else (), 0, len(order))
        self.rows, self.program = writer.rows, writer.numbers()

    @property
    def said(self):
        """How its function is called."""
        if self.held:
            return f"is called in Python every {self.force.period:g} s"
        return f"is called in Python at each evaluation: {self.why}" if self.why else "is traced and runs compiled"

    @property
    def no_series(self):
        """Why it has no Taylor series; "" where it has them."""
        if self.why:
            return f"its {self.force.given} is a function of the scene's state that can't be traced, {self.why}"
        if self.force.checked:
            return ""
        return f"its {self.force.given} may change within any part of a step" if self.changes else ""

    # In arrays.

    def pack(self, table, reals, memory):
        """Append the instances, one for each pair of bodies, and the head.

        Return the number of instances, and how many reals each has.
        """
        force, at, count = self.force, len(reals), len(self.numbers)
        own = np.concatenate(force.coordinates).tolist()
        stride, pairs = len(own) + count + loops.PAIR, self._pairs()
        block, seen = np.zeros((len(pairs), stride)), set()
        block[0, : stride - loops.PAIR] = [*own, *force.parameters()]
        for row, (i, j) in zip(block, pairs, strict=True):
            (a, m), (b, n) = self.places[i], self.places[j] if j >= 0 else (0, 0)
            table += [a, b, m, n]
            row[loops.FIRST_OF_PAIR], row[loops.SECOND_OF_PAIR] = i, j
            row[loops.FIRST_OWN], row[loops.SECOND_OWN] = i not in seen, j not in seen
            seen |= {i, j}
        block[:, loops.FORWARD] = stride * np.arange(len(pairs), 0, -1)
        block[0, loops.LEADS] = 1.0
        head = self._head(len(own))
        first = at + block.size + int(head[loops.MEMORY])
        memory += range(first, first + (self.values if self.held else len(self.counted)))
        reals += block.ravel().tolist()
        reals += head
        if not (self.traced or self.held):
            self.address = at + block.size + loops.FUNCTION
            reals[self.address] = self.callback
        return len(pairs), stride

    def _pairs(self):
        """Pairs of places in `bodies` of which one at least is acted on; (i, -1) where there is one body."""
        if len(self.bodies) == 1:
            return [(0, -1)]
        return [(i, j) for i, j in combinations(range(len(self.bodies)), 2) if max(self.acted[i], self.acted[j]) >= 0]

    def _head(self, par):
        """The numbers of the head and what it refers to."""
        bodies = [x for place, acted in zip(self.places, self.acted, strict=True) for x in (*place, acted)]
        angles = [x for geometry in self._geometries for x in self._angle(geometry)]
        rows = loops.ORDERS * self.rows
        slopes = self.values * (1 + 2 * self.coordinates)
        values = 0 if self.traced else self.values
        turns = len(self.counted)
        sizes = [len(bodies), len(angles), len(self.program), rows, 2 * self.coordinates, slopes, turns]
        sizes += [self.values if self.held else turns]
        body_at, angle_at, program, row_at, state, slope_at, theta, kept, end = loops.HEAD + np.cumsum([0, *sizes])
        acted = sum(place >= 0 for place in self.acted)
        head = [
            len(self.bodies), body_at, self.coordinates, values, 0, len(self.numbers), par, kept, len(self.counted),
            angle_at, self.traced, program, row_at, self.rows, self.results, acted, state, slope_at, theta,
        ]  # fmt: skip
        found = [float(x) for x in (*head, *bodies, *angles, *self.program)]
        return found + [0.0] * int(end - len(found))

    def _angle(self, geometry):
        """The numbers of a counted angle in the head, ANGLE_WIDTH of them."""
        for body in (geometry.own, geometry.other):
            at, dimension = self.handles.where(body)
            index = self.handles.bodies.index(body) if dimension else -1
            yield from (at, dimension, self.bodies.index(index) if index in self.bodies else -1)
        yield from (*geometry.f, *geometry.g, *geometry.h)

    # In Python.

    @property
    def callback(self):
        """The address of what calls the function in Python."""
        if self._callback is None:
            self._callback = PythonCallback(self._called, loops.CALL)
        return self._callback.address

    def _called(self, *given):
        """Let the function give its values; NaN if it raises, or after a Ctrl-C."""
        try:
            if not _keyboard.pressed:
                self._give(*given)
        except KeyboardInterrupt:
            _keyboard.pressed = True
        if _keyboard.pressed:
            _view(given[-1], self.values)[:] = math.nan
        return 0

    def _give(self, q, qd, angles, numbers, t, out):
        out = _view(out, self.values)
        try:
            parts = _view(q, self._n).copy(), _view(qd, self._n).copy(), _view(angles, self.handles.count).copy()
            out[:] = self.evaluate(t, *parts, _view(numbers, len(self.numbers)).tolist())
        except Exception:
            out[:] = math.nan

    def __getstate__(self):
        return {**self.__dict__, "_callback": None}


# Ctrl-C while kernels call laws. Kernels pass no exception on, and ctypes loses one that is raised in `_called` itself,
# where Python handles a Ctrl-C that came within the kernel. It is therefore kept: further calls give NaN, which ends
# the kernel's work, and KeyboardInterrupt is raised after that.


class _Keyboard(threading.local):
    pressed = False


_keyboard = _Keyboard()


@contextlib.contextmanager
def interrupts_answered():
    """Raise KeyboardInterrupt at the end of a block, or before, if Ctrl-C comes while its kernels call laws."""
    own = raises_here()
    if own:
        signal.signal(signal.SIGINT, _press)
    try:
        yield
    finally:
        if own:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        pressed, _keyboard.pressed = _keyboard.pressed, False
        if pressed:
            raise KeyboardInterrupt


def calls_laws(packed):
    """Whether kernels call laws of a scene in Python."""
    return any(load.law is not None and load.law.address >= 0 for load in packed.loads)


def _press(number, frame):
    """Keep a Ctrl-C; the first one also ends what the function of a law is doing."""
    again, _keyboard.pressed = _keyboard.pressed, True
    if not again and frame.f_code is not Law._called.__code__:
        raise KeyboardInterrupt


def _view(given, count):
    """So many floats at an address; in debug mode, of an array."""
    if isinstance(given, np.ndarray):
        return given[:count]
    return np.frombuffer((ctypes.c_double * count).from_address(given)) if count else np.empty(0)


def _graph(value):
    return value if isinstance(value, Smooth) else constant(float(value))


def _rate(state, geometry):
    """The rate of an angle."""
    return angle_of(geometry, *state._motions(geometry), 1)


def seen_by(function, known=()):
    """What a function that is traced depends on besides its arguments, to be compared: code, numbers, arrays, handles.

    Raises
    ------
    Untraceable
        Of an object that may change unseen.
    """
    plain = getattr(function, "py_func", function)
    if plain in known:
        return ()
    seen = (_seen(value, (*known, plain)) for value in captured(plain))
    return plain.__code__.co_code, str(plain.__code__.co_consts), *seen


def _seen(value, known):
    plain = getattr(value, "py_func", value)
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, (int, float, str, np.number)) or value is None:
        return value
    if isinstance(value, (list, tuple)):
        return tuple(_seen(one, known) for one in value)
    module = str(getattr(value, "__module__", "")).partition(".")[0]
    if value is np or value is math or module == "numpy" or isinstance(value, HANDLES):
        return id(value)
    if isinstance(plain, FunctionType):
        return seen_by(plain, known)
    raise Untraceable(f"it uses an object that may change, {value!r:.60}")


# What the values act as: F (ground frame) and tau' (body frame) on each body.


def _loads(actions, state, values, handles):
    """{body: (F, tau')}, lists of three symbols."""
    found = {}

    def add(body, force, torque):
        if body is None or not body.dimension:
            return
        F, N = found.setdefault(body, ([0.0] * 3, [0.0] * 3))
        for i in range(3):
            F[i], N[i] = F[i] + force[i], N[i] + torque[i]

    nothing = (0.0, 0.0, 0.0)
    for action, u in zip(actions, values, strict=True):
        a, b = (None if body is None else BodyMotion(*handles.where(body), state._levels) for body in action[1:3])
        d, own = _direction(action, a, b, state, handles)
        F = tuple(u * x for x in d)  # ground frame
        mine = tuple(u * x for x in own) if own is not None else to_body(a.p, F) if a.dimension == 7 else nothing
        if action.turns:
            add(action.a, nothing, mine)
            if b is not None and b.dimension == 7:
                add(action.b, nothing, tuple(-x for x in to_body(b.p, F)))
            continue
        s = action.point if a.dimension == 7 else nothing
        add(action.a, F, cross(s, mine) if a.dimension == 7 else nothing)
        if b is not None and b.dimension:
            back, place = tuple(-x for x in F), a.point(action.point, 0)
            arm = tuple(x - y for x, y in zip(place, b.centroid(0), strict=True))
            add(action.b, back, to_body(b.p, cross(arm, back)) if b.dimension == 7 else nothing)
    return found


def _direction(action, a, b, state, handles):
    """The direction in the ground frame, and in that of a where it is given there."""
    if not action.direction:
        d = [x - y for x, y in zip(b.point(action.other, 0), a.point(action.point, 0), strict=True)]
        length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) ** 0.5
        return tuple(x / length for x in d), None
    if action.frame is None or action.frame.dimension != 7:
        return action.direction, None
    frame = BodyMotion(*handles.where(action.frame), state._levels)
    return to_ground(frame.p, action.direction), action.direction if action.frame is action.a else None


# What a law says when it is added.


def demand_callable(force, handles, t, q, qd, angles):
    """Try a law once at a state.

    Raises
    ------
    InvalidForce
        If the function gives another number of values than there are actuators, or raises what no other state mends.
    TsdynError
        Of a body or joint that it asks for and the scene hasn't.
    """
    law = Law.__new__(Law)
    law.force, law.handles, law.values = force, handles, len(force.actions())
    own = f"{force.name}: "  # what begins so says where already
    try:
        with np.errstate(all="ignore"):
            law.evaluate(t, q, qd, angles, force.parameters())
    except TsdynError as error:
        if str(error).startswith(own):
            raise
        kind = force.error if isinstance(error, AttributeError) else type(error)
        raise kind(f"{own}its {force.given} can't be evaluated: {error}") from error
    except (ArithmeticError, ValueError):
        pass
    except Exception as error:
        raise force.error(
            f"{force.name}: its {force.given} raises {type(error).__name__} at the start: {str(error).rstrip('.')}."
        ) from error


# Python functions that kernels call by address, as they call a `Callback`.

KINDS = {"i": ctypes.c_int64, "d": ctypes.c_double, "p": ctypes.c_void_p}


class PythonCallback:
    """A Python function with an `address`; it is given addresses of arrays, in debug mode the arrays.

    An exception of it is lost: the function has to answer for its own.
    """

    def __init__(self, function, signature):
        self._kept = ctypes.CFUNCTYPE(ctypes.c_int64, *(KINDS[c] for c in signature))(function)
        self.address = ctypes.cast(self._kept, ctypes.c_void_p).value
        if DEBUG:
            table.append(function)
            self.address = len(table) - 1
