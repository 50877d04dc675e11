"""What a constraint primitive is: a class whose kernels are compiled once and reached by address.

A primitive works on marker coordinates x (3-vectors in the ground frame) and never sees Euler parameters:

    phi(x, par, t, out)          out[rows]          Phi
    jacobian(x, par, t, out)     out[rows, len(x)]  Phi_x, zero on entry
    gamma(x, xd, par, t, out)    out[rows]          (Phi_x xd)_x xd + 2 Phi_xt xd + Phi_tt
    phi_t(x, par, t, out)        out[rows]          Phi_t; only for a primitive that depends on time

x is the concatenation of the primitive's markers, par the floats that `parameters()` returns; a motion among them takes
three places, its value, rate and acceleration at t. The loops below apply the chain rule x(q) (Haug 2018, Eqs. 2-3).
Kernels use arithmetic and NumPy functions, no comparison, abs or norm of x, so that they also run on complex numbers
and on truncated Taylor series: that is how they are checked.
"""

from types import MappingProxyType

from . import curvature
from ._kernel import Callback, caller, integers, kernel, specialised, stack, stack2, vector
from .bodies import Ground, PointMass
from .checks import demand_known
from .errors import InvalidConstraint
from .markers import PARAMETERS, Marker, chain_rule, motion, position
from .motion import Motion

# what the table of a kind holds for each instance
AT, DIMENSION, BLOCK, ROW, STRIDE, INTS = 0, 2, 4, 6, 7, 8
SIGNATURE = "iippppdp"  # count, reals per instance, table, reals, q, qd, t, out
ANY = 1 << 40  # the length of arrays whose length a kernel doesn't need
call_kind = caller(SIGNATURE)

_registry = {}
_KERNELS = {"phi": 4, "jacobian": 4, "gamma": 5}  # and their numbers of arguments
_OPTIONAL = {"phi_t": 4}


class Primitive:
    """Base class of all constraints that have rows of their own.

    Subclass it in one file of your own: set `rows` and `markers`, write the kernels as static methods, and pass the
    bodies and the marker coordinates on in `__init__`. `tsdyn.testing.check_primitive` checks the result.

    Attributes
    ----------
    rows : int
        Number of scalar constraints.
    markers : tuple of Point, Vector, Parameters
        What x is made of, each on body "a" or "b".
    prescribed : str, optional
        The attribute that is a number or a Motion, where nothing else makes it depend on time.
    a, b : Body or ground
        The bodies; b is None for a primitive that has markers on a only.
    name : str
        What error messages call it.
    """

    rows = 0
    markers = ()
    prescribed = ""
    added = False  # to its scene
    kernels = MappingProxyType({})  # name -> Callback, compiled when a scene first uses the kind

    def __init_subclass__(cls, **keywords):
        super().__init_subclass__(**keywords)
        where = f"primitive {cls.__name__}"
        if isinstance(cls.rows, bool) or not isinstance(cls.rows, int) or cls.rows < 1:
            raise InvalidConstraint(f"{where}: rows must be the number of its scalar constraints, 1 or more.")
        markers = cls.markers if isinstance(cls.markers, (tuple, list)) else ()
        if not markers or not all(isinstance(m, Marker) for m in markers):
            raise InvalidConstraint(f"{where}: markers must be a tuple of Point, Vector or Parameters.")
        functions = {}
        for name, arguments in {**_KERNELS, **_OPTIONAL}.items():
            function = getattr(cls, name, None)
            if function is None and name in _OPTIONAL:
                continue
            code = getattr(getattr(function, "py_func", function), "__code__", None)
            if code is None or code.co_argcount != arguments:
                raise InvalidConstraint(f"{where}: write {name} as a static method with {arguments} arguments.")
            functions[name] = function
        cls.kernels = MappingProxyType(_compile(cls, functions))
        _registry[f"{cls.__module__}.{cls.__qualname__}"] = cls

    def __init__(self, a, b=None, coordinates=(), name=""):
        """Attach the primitive to its bodies; coordinates has an entry for each marker, in the body frame."""
        self.a, self.b = a, b
        kind = type(self).__name__
        if not self.rows:
            raise InvalidConstraint(
                "Primitive is the base of constraints and has no rows; use one of them, or a subclass."
            )
        needed = {marker.body for marker in self.markers} | {"a"}
        bodies = [body for body, letter in ((a, "a"), (b, "b")) if body is not None or letter in needed]
        for body in bodies:
            if not isinstance(body, (PointMass, Ground)):
                raise InvalidConstraint(
                    f"{name or kind}: {body!r} is not a body; pass one that add_body returned, or the ground."
                )
        self.name = str(name) or f"{kind}({', '.join(body.name for body in bodies)})"
        if all(body.dimension == 0 for body in bodies):
            raise InvalidConstraint(f"{self.name}: one of the bodies must not be the ground.")
        if len(bodies) == 2 and a is b:
            raise InvalidConstraint(f"{self.name}: it joins {a.name!r} to itself; pass two different bodies.")
        if len({id(body.scene) for body in bodies}) != 1:
            raise InvalidConstraint(f"{self.name}: {a.name!r} and {b.name!r} belong to different scenes.")
        given = list(coordinates) or [None] * len(self.markers)
        if len(given) != len(self.markers):
            raise InvalidConstraint(f"{self.name}: {len(self.markers)} markers, but {len(given)} coordinates.")
        self.coordinates = tuple(
            marker.coordinates(self.body_of(marker), value, self.name)
            for marker, value in zip(self.markers, given, strict=True)
        )

    def __setattr__(self, name, value):
        """Set an attribute, checked; the scene packs its numbers again.

        A marker's argument (`point_a`, ...) may be set as well as a prescribed value. Once the constraint is in its
        scene, a name that it does not have is refused.
        """
        if name == self.prescribed:
            value = Motion.wrap(value, f"{self.name}: {name}")
        slots = [marker.argument for marker in self.markers]
        if name in slots and "coordinates" in self.__dict__:
            i = slots.index(name)
            place = self.markers[i].coordinates(self.body_of(self.markers[i]), value, self.name)
            name, value = "coordinates", (*self.coordinates[:i], place, *self.coordinates[i + 1 :])
        if not self.added:
            super().__setattr__(name, value)
            return
        demand_known(self, name, self.__dict__)
        before = self.__dict__[name]
        super().__setattr__(name, value)
        try:
            self.check()
        except InvalidConstraint:
            super().__setattr__(name, before)
            raise
        self.scene.touch()

    def __getattr__(self, name):
        """The body-frame coordinates of a marker, by its argument."""
        for marker, place in zip(self.markers, self.__dict__.get("coordinates", ()), strict=False):
            if marker.argument == name:
                return place
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def check(self):
        """Raise InvalidConstraint where an attribute has an impossible value; asked again when one is set."""

    @property
    def scene(self):
        """The scene of its bodies."""
        return self.a.scene

    def body_of(self, marker):
        """The body that a marker is on."""
        return self.a if marker.body == "a" else self.b

    @property
    def rheonomic(self):
        """Whether it depends on time."""
        moves = not self.prescribed or isinstance(getattr(self, self.prescribed), Motion)
        return moves and "phi_t" in self.kernels

    def parameters(self):
        """The floats and motions that the kernels get as `par`."""
        return ()

    @classmethod
    def example(cls, rng, a, b):
        """Return a random valid instance between two bodies, for tests."""
        places = {m.argument: rng.normal(size=3) for m in cls.markers if m.code != PARAMETERS}
        return cls(a, b, **places) if any(m.body == "b" for m in cls.markers) else cls(a, **places)

    def __repr__(self):
        return f"<{type(self).__name__} {self.name!r}>"


def registered():
    """Return every primitive class known, built in or plugged in, by its full name."""
    return MappingProxyType(_registry)


def _compile(cls, functions):
    """Make the callbacks of a kind: each runs over all its instances."""
    owners = [0 if m.body == "a" else 1 for m in cls.markers]
    sizes = [m.size for m in cls.markers]
    constants = {
        "ROWS": cls.rows,
        "MARKERS": len(cls.markers),
        "CODES": tuple(m.code for m in cls.markers),
        "OWNERS": tuple(owners),
        "STARTS": tuple(sum(sizes[:i]) for i in range(len(sizes))),
        "FIRST": tuple(int(owner not in owners[:i]) for i, owner in enumerate(owners)),
        "SIZE": sum(sizes),
    }
    try:
        inner = {f"kernel_{name}": _inlined(function) for name, function in functions.items()}
    except InvalidConstraint as error:
        raise InvalidConstraint(f"primitive {cls.__name__}: {error}") from error
    loops = {"phi": _values, "phi_t": _values, "jacobian": _jacobian, "gamma": _gamma}
    result = {}
    for name, function in functions.items():
        owner = getattr(function, "py_func", function)
        names = {**constants, **inner, "kernel_value": inner[f"kernel_{name}"]}
        copy = specialised(loops[name], f"{cls.__qualname__}.{name}_loop", owner, **names)
        result[name] = Callback(copy, SIGNATURE)
    owner = getattr(functions["gamma"], "py_func", functions["gamma"])
    places = {"AT": AT, "DIMENSION": DIMENSION, "ROW": ROW, "INTS": INTS}
    copy = specialised(curvature.loop, f"{cls.__qualname__}.curvature_loop", owner, **constants, **inner, **places)
    result["curvature"] = Callback(copy, curvature.SIGNATURE)
    return result


def _inlined(function):
    return function if hasattr(function, "py_func") else kernel(function)


# The loops over all instances of a kind. The names in capitals and kernel_* are filled in by `_compile`.
ROWS = MARKERS = SIZE = 1
CODES = OWNERS = STARTS = FIRST = (0,)
kernel_value = kernel_jacobian = kernel_gamma = None


def _values(count, stride, table, reals, q, qd, t, out):
    table, reals, q, out = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(out, ANY)
    x, f = stack(SIZE), stack(ROWS)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        for j in range(MARKERS):
            k = OWNERS[j]
            position(CODES[j], own[DIMENSION + k], own[AT + k], q, real[3 * j : 3 * j + 3], x[STARTS[j] :])
        kernel_value(x, real[3 * MARKERS :], t, f)
        for r in range(ROWS):
            out[own[ROW] + r] = f[r]
    return 0


def _jacobian(count, stride, table, reals, q, qd, t, out):
    table, reals, q, out = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(out, ANY)
    x, f = stack(SIZE), stack2(ROWS, SIZE)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        for j in range(MARKERS):
            k = OWNERS[j]
            position(CODES[j], own[DIMENSION + k], own[AT + k], q, real[3 * j : 3 * j + 3], x[STARTS[j] :])
        for r in range(ROWS):
            for c in range(SIZE):
                f[r, c] = 0.0
        kernel_jacobian(x, real[3 * MARKERS :], t, f)
        for r in range(ROWS):
            for j in range(MARKERS):
                k = OWNERS[j]
                block = own[BLOCK + k] + r * own[STRIDE]
                s, row = real[3 * j : 3 * j + 3], f[r, STARTS[j] :]
                chain_rule(CODES[j], own[DIMENSION + k], own[AT + k], q, s, row, FIRST[j], out[block:])
    return 0


def _gamma(count, stride, table, reals, q, qd, t, out):
    table, reals, q, out = integers(table, ANY), vector(reals, ANY), vector(q, ANY), vector(out, ANY)
    qd = vector(qd, ANY)
    x, xd, xdd = stack(SIZE), stack(SIZE), stack(SIZE)
    f, g = stack2(ROWS, SIZE), stack(ROWS)
    for i in range(count):
        own, real = table[i * INTS : (i + 1) * INTS], reals[i * stride : (i + 1) * stride]
        for j in range(MARKERS):
            k, c = OWNERS[j], STARTS[j]
            s = real[3 * j : 3 * j + 3]
            motion(CODES[j], own[DIMENSION + k], own[AT + k], q, qd, s, x[c:], xd[c:], xdd[c:])
        for r in range(ROWS):
            for c in range(SIZE):
                f[r, c] = 0.0
        kernel_jacobian(x, real[3 * MARKERS :], t, f)
        kernel_gamma(x, xd, real[3 * MARKERS :], t, g)
        for r in range(ROWS):
            total = g[r]
            for c in range(SIZE):
                total += f[r, c] * xdd[c]
            out[own[ROW] + r] = total
    return 0
