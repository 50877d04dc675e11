"""The interface of a force: a class whose kernel is compiled once and called by address.

A force works on marker coordinates x and their rates xd (ground frame) and never sees Euler parameters:

    law(x, xd, par, t, out)        out[len(x)]  the force conjugate to x: its power is out . xd
    potential(x, par, t)           optional; the potential energy, J
    dissipation(x, xd, par, t)     optional; the power that dampers or friction take, W, >= 0
    remember(x, xd, par, t)        optional, with memory = 1: what par[-1] is after each accepted step
    series(x, xd, par, k, s, out)  optional; out[len(x)]  coefficient k of the law's Taylor series, see recurrences.py
    driven_series                  optional; the same with the series of par in the rows of s from `slots` on
    normal_load(x, f, par)         optional, of friction: what par[-1] is, from a reaction f, see friction.py
    normal_series(x, f, par, k, s) optional, of friction: coefficient k of that; series is for par[-1] = 1 then

x is the concatenation of the force's markers, par the floats that `parameters()` returns, functions of time among them
evaluated at t. A Point is conjugate to a force, a Turn to a torque, both in the ground frame. Work that belongs to
`potential` or `dissipation` is declared by these methods; the remainder of out . xd counts as applied power.

`law` uses arithmetic and NumPy functions of scalars and is analytic in x and xd (no comparison, abs or norm), since
complex steps of it give the Jacobians of implicit methods; write products instead of powers of x. Where that is
impossible, set analytic = False for central differences. `potential` and `dissipation` are evaluated by NumPy on
arrays. `series` receives coefficient k of x and xd and fills column k of the scratch array s[slots, k].
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Never, Self

from ..errors import InvalidForce
from ..jit.kernels import Callback, kernel, specialised
from ..motions.signals import Signal
from .element import Attachment, check_slots, inlined, layout, static_kernel
from .loops import constraint_series, force_series, friction, law_check
from .loops import forces as loops
from .loops.coordinate_rows import SIGNATURE
from .markers import PARAMETERS, TURN, Marker, Point

if TYPE_CHECKING:
    from ..hints import AnyBody, Callable, Mapping, Random

_registry = {}
_KERNELS = {"law": 5}  # and their numbers of arguments
_OPTIONAL = {"potential": 3, "dissipation": 4, "remember": 4, "normal_load": 3}
_SERIES = {"series": 6, "driven_series": 6, "inputs": 6, "normal_series": 5}


class Force(Attachment):
    """Base class of all forces.

    Subclass it in one file of your own: set `markers`, write `law` as a static method; an `__init__` with
    further arguments passes the bodies and `**places` on. `tsdyn.testing.check_force` checks the result.

    Attributes
    ----------
    markers : tuple of Point, Vector, Parameters, Turn
        What x is made of, each on body "a" or "b".
    memory : int
        1 for a force that remembers a number from step to step: it is the last of par, and zero at first.
    taken : int
        Numbers of par, behind those of `parameters()`, that a run sets where one of its phases begins, such as the
        direction in which a block begins to slide; zero at first. They may differ from force to force.
    slots : int
        Rows of scratch memory that `series` uses.
    no_series : str
        Why there is none.
    sharp : bool
        Whether the law may change within less than its series shows, as |v| does at v = 0: steps by series are then
        checked against the law.
    positive : tuple of int, or None
        Rows of the scratch memory that `series` divides by or takes roots or angles of: a law is analytic while they
        are positive, and a step in which one may vanish is checked against the law. () for a law that is analytic
        everywhere, such as a polynomial; None where nothing is known, and the end of every step is checked.
    analytic : bool
        Whether `law` can be run on complex numbers.
    particles : bool
        Whether Parameters and Turn may be on a point mass, as (1, 0, 0, 0) and zero.
    quantities : mapping
        Attribute -> function (value, what, error) that checks a value that is set and returns it.
    loads : tuple of str
        The attributes whose work is applied power.
    sources : tuple of str
        The attributes of which one at least must differ from zero when it is made; all may be zero later.
    conservative : bool
        Whether all but the loads' work is in potential and dissipation, however the bodies move.
    a, b : Body or ground
    name : str

    Examples
    --------
    A point of a body is pulled back to the z axis by -8 d:

    >>> import tsdyn as ts
    >>> class Pole(ts.Force):
    ...     markers = (ts.Point("a"),)
    ...     @staticmethod
    ...     def law(x, xd, par, t, out):
    ...         out[0], out[1] = -8.0 * x[0], -8.0 * x[1]
    ...     @staticmethod
    ...     def potential(x, par, t):
    ...         return 4.0 * (x[0] * x[0] + x[1] * x[1])
    >>> scene = ts.Scene()
    >>> ball = scene.add_point_mass(mass=1.0, position=(0.5, 0, 0))
    >>> scene.add(Pole(ball))
    <Pole 'Pole(body1)'>
    """

    error = InvalidForce
    lacks = "forces and has no law"
    memory = 0
    slots = 0
    no_series = ""
    sharp = False
    adds_inertia = False  # whether it has an `inertia_row`, a primitive whose row h adds h^T h to the mass matrix
    slips = False  # whether it is friction, which changes at rest within a slip velocity
    positive: tuple[int, ...] | None = None
    analytic = True
    quantities: Mapping[str, Callable[..., Any]] = MappingProxyType({})
    loads: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    conservative = True
    own_kernels = MappingProxyType(
        {}
    )  # force, jacobian, remember -> Callback, compiled when a scene first uses the kind

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        where = f"force {cls.__name__}"
        markers = cls.markers if isinstance(cls.markers, (tuple, list)) else ()
        if not markers or not all(isinstance(m, Marker) for m in markers):
            raise InvalidForce(f"{where}: markers must be a tuple of Point, Vector, Parameters or Turn.")
        if cls.memory not in (0, 1) or (cls.memory == 1) != (getattr(cls, "remember", None) is not None):
            raise InvalidForce(f"{where}: memory = 1 needs a kernel remember, and remember needs memory = 1.")
        check_slots(cls, where, InvalidForce)
        rows = () if cls.positive is None else cls.positive
        if not isinstance(rows, tuple) or not all(type(row) is int and 0 <= row < cls.slots for row in rows):
            raise InvalidForce(
                f"{where}: positive must be a tuple of rows of the scratch memory, each from 0 to slots - 1, or None, "
                f"got {cls.positive!r}."
            )
        functions = {}
        for name, arguments in {**_KERNELS, **_OPTIONAL, **_SERIES}.items():
            if name not in _KERNELS and (getattr(cls, name, None) is None or _is_superseded(cls, name)):
                continue
            functions[name] = static_kernel(cls, name, arguments, where, InvalidForce)
        try:
            cls.own_kernels = callbacks(cls, functions)
        except InvalidForce:
            raise
        except Exception as error:
            raise InvalidForce(f"{where}: {error}") from error
        if not cls.__name__.startswith("_"):
            _registry[f"{cls.__module__}.{cls.__qualname__}"] = cls

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked by `quantities`."""
        if name in self.quantities:
            value = self.quantities[name](value, f"{self.name}: {name}", self.error)
        super().__setattr__(name, value)

    @property
    def kernels(self) -> Mapping[str, Any]:
        """The callbacks that run it; forces with the same ones are run together."""
        return self.own_kernels

    @property
    def bodies(self) -> tuple[Any, ...]:
        """The bodies that it acts on; the ground, and None, may be among them."""
        return self.a, self.b

    @property
    def is_idle(self) -> bool:
        """Whether all of its sources are zero at all times."""
        return bool(self.sources) and all(Signal.is_zero(getattr(self, name)) for name in self.sources)

    def demand_effect(self) -> None:
        """Refuse a force all of whose sources are zero when it is made; values that are set later may be."""
        if self.is_idle:
            raise self.error(f"{self.name}: it is zero at all times; set {' or '.join(self.sources)}.")

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """Return a random valid instance between two bodies, for tests."""
        places = {m.argument: rng.normal(size=3) for m in cls.markers if m.code not in (PARAMETERS, TURN)}
        return cls(a, b, **places) if any(m.body == "b" for m in cls.markers) else cls(a, **places)


def _is_superseded(cls, name):
    """Whether a kernel is the series of a law that a subclass has redefined."""
    by_class = [name in vars(each) for each in cls.__mro__]
    laws = [{"law", "normal_load"} & vars(each).keys() for each in cls.__mro__]
    return name in _SERIES and any(laws[: by_class.index(True)])


def load(value, what, error):
    """A finite float, a function of time or a Table."""
    return Signal.wrap(value, 1, what, error)


def vector_load(value, what, error):
    """Three finite floats, a function of time that returns three, or a Table."""
    return Signal.wrap(value, 3, what, error)


def registered() -> Mapping[str, type[Force]]:
    """Return every force class known, built in or plugged in, by its full name."""
    return MappingProxyType(_registry)


def callbacks(cls, functions, owner=None):
    """Make the callbacks of a kind, each runs over all its instances; `owner` says where they are cached.

    With an owner, a function of a user's, the kernels may allocate and raise.
    """
    constants = layout(cls.markers)
    make = _allocating if owner else inlined
    home = owner or getattr(functions["law"], "py_func", functions["law"])
    label = f"{owner.__qualname__}.{cls.__name__}" if owner else cls.__qualname__
    names = {**constants, "kernel_law": make(functions["law"]), "FRICTIONAL": "normal_load" in functions}
    steps = loops.complex_steps if cls.analytic else loops.central_differences
    names["kernel_derivatives"] = make(specialised(steps, f"{label}.derivatives", home, make, **names))
    names["KEPT"] = loops.kept_size(cls.markers)
    names["ALONG"] = 3 if [type(m) for m in cls.markers] == [Point, Point] else -1  # a frame along its two points
    result = {}
    for name, template, signature in (("force", loops.forces, SIGNATURE), ("jacobian", loops.jacobian, loops.JACOBIAN)):
        copy = specialised(template, f"{label}.{name}_loop", home, make, **names)
        result[name] = Callback(copy, signature, allocates=owner is not None)
    if "remember" in functions:
        home = getattr(functions["remember"], "py_func", functions["remember"])
        names["kernel_remember"] = inlined(functions["remember"])
        result["remember"] = Callback(specialised(loops.remembers, f"{label}.remember_loop", home, **names), SIGNATURE)
    if "normal_load" in functions:
        result |= _friction_callbacks(cls, label, names, functions)
    if owner is None and ("normal_series" in functions or "normal_load" not in functions):
        result |= _series_callbacks(cls, label, names, functions)
    return MappingProxyType(result)


def _allocating(function):
    return kernel(function, allocates=True)


def _friction_callbacks(cls, label, names, functions):
    """The loops of friction in proportion to a normal load; its kernels are added to `names`."""
    result, loops = {}, ["unit_friction", "normal_load"]
    names["kernel_normal_load"] = inlined(functions["normal_load"])
    if "normal_series" in functions:
        names |= {"kernel_normal_series": inlined(functions["normal_series"]), "SLOTS": cls.slots}
        loops.append("load_slope")
    for name in loops:
        function = functions["normal_series" if name == "load_slope" else "normal_load"]
        home = getattr(function, "py_func", function)
        copy = specialised(getattr(friction, name), f"{label}.{name}_loop", home, **names)
        result[name] = Callback(copy, getattr(friction, name.upper()))
    return result


def _series_callbacks(cls, label, names, functions):
    """The loops of `series` and of `driven_series`, those of laws that are checked with the check."""
    result = {}
    traced = "inputs" in functions
    if traced:
        names |= {"kernel_inputs": inlined(functions["inputs"])}
    for before, driven in (("", False), ("driven_", True)):
        if before + "series" not in functions:
            continue
        function = functions[before + "series"]
        sharp = cls.sharp or driven
        own = {**names, "kernel_series": inlined(function), "SLOTS": cls.slots, "SHARP": sharp}
        own |= {"DRIVEN": driven, "TRACED": traced, "POSITIVE": cls.positive or ()}
        home = getattr(function, "py_func", function)
        copy = specialised(force_series.series, f"{label}.{before}series_loop", home, **own)
        result[before + "series"] = Callback(copy, constraint_series.SIGNATURE)
        if sharp or cls.positive != ():
            copy = specialised(law_check.check, f"{label}.{before}check_loop", home, **own)
            result[before + "check"] = Callback(copy, law_check.SIGNATURE)
        if cls.positive:
            copy = specialised(law_check.margin, f"{label}.{before}margin_loop", home, **own)
            result[before + "margin"] = Callback(copy, law_check.MARGIN)
    return result
