"""The interface of a constraint primitive: a class whose kernels are compiled once and called by address.

A primitive works on marker coordinates x (3-vectors in the ground frame) and never sees Euler parameters:

    phi(x, par, t, out)          out[rows]          Phi
    jacobian(x, par, t, out)     out[rows, len(x)]  Phi_x, zero on entry
    gamma(x, xd, par, t, out)    out[rows]          (Phi_x xd)_x xd + 2 Phi_xt xd + Phi_tt
    phi_t(x, par, t, out)        out[rows]          Phi_t; only for a primitive that depends on time
    series(x, par, k, s, out)    out[rows, len(x)]  optional: coefficient k of Phi_x, zero on entry; see recurrences.py
    series_t(x, par, k, s, out)  out[rows]          and of Phi_t, where it has what is `prescribed`; after `series`
    arm_series(n, par, k, s, out)  out[3]           optional: coefficient k of the arm of a contact, see below
    remember(x, par, t)          optional, with memory = 1: what the last of par is after each accepted step

Rows on velocities, A(x, t) xd + b(x, t) = 0, follow the rows on positions; a primitive may have either or both:

    rate(x, xd, par, t, out)        out[rate_rows]          A xd + b, linear in xd
    rate_jacobian(x, par, t, out)   out[rate_rows, len(x)]  A, zero on entry
    rate_gamma(x, xd, par, t, out)  out[rate_rows]          (A xd)_x xd + A_t xd + b_x xd + b_t

A contact has rows along directions of b: derivatives of rows, and rows on velocities, are the velocities of a's
material point at the contact along them. Its arm, from the first marker, a Point of a, follows from the normal n, both
in components along the next three markers, Vectors of a. On the ground `arm_series` serves in place of `series`, in
less time.

`series` is of Phi_x and, below it, A; `series_t` of Phi_t and b. To the solver a row on velocities is a row of Phi that
is zero everywhere, with A for Phi_x, b for Phi_t and rate_gamma for gamma (loops/rate_rows.py).

x is the concatenation of the primitive's markers, par the floats that `parameters()` returns; a motion among them
occupies three: value, rate and acceleration at t. The loops over all instances of a kind (loops/) apply the chain
rule x(q) (Haug 2018, Eqs. 2-3).
Kernels use arithmetic and NumPy functions, no comparison, abs or norm of x, so that checks can run them on complex
numbers and truncated Taylor series. `series` receives coefficient k of x and fills column k of the scratch array
s[slots, k], where earlier coefficients remain.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Never, Self

import numpy as np

from ..errors import InvalidConstraint
from ..jit.kernels import Callback, specialised, twin
from ..motions.prescribed import Motion
from .element import Attachment, check_slots, inlined, layout, static_kernel
from .loops import constraint_hessians, constraint_rows, constraint_series, coordinate_rows, ground_contacts, rate_rows
from .markers import PARAMETERS, POINT, TURN, VECTOR, Marker

if TYPE_CHECKING:
    from ..hints import AnyBody, Mapping, Random

_registry = {}
_KERNELS = {"phi": 4, "jacobian": 4, "gamma": 5}  # and their numbers of arguments
_RATE_KERNELS = {"rate": 5, "rate_jacobian": 4, "rate_gamma": 5}
_OPTIONAL = {"phi_t": 4, "series": 5, "series_t": 5, "arm_series": 5, "remember": 3}


class Primitive(Attachment):
    """Base class of all constraints that have rows of their own.

    Subclass it in one file of your own: set `rows` and `markers`, write the kernels as static methods; an `__init__`
    with further arguments passes the bodies and `**places` on. `tsdyn.testing.check_primitive` checks the result.

    Attributes
    ----------
    rows : int
        Number of scalar constraints on positions.
    rate_rows : int
        Number of scalar constraints on velocities.
    markers : tuple of Point, Vector, Parameters
        What x is made of, each on body "a" or "b".
    slots : int
        Rows of scratch memory that `series` uses.
    prescribed : str or tuple of str, optional
        The attributes that are numbers or Motions, where nothing else makes it depend on time. With `series_t` they
        come first in `parameters()`, and their series are the rows of scratch memory from `slots` on.
    normal : str, optional
        Of a contact with `arm_series`: the marker of b that its first row is along, after a Point of the plane; other
        rows are along the markers after it.
    summed : bool
        Whether an instance may be a term of a row that several instances add up to, each on two bodies: see `SumRow`.
    memory : int
        How many numbers it keeps from step to step, the last of par: angles that count turns. `remember` returns the
        last of them, and writes the others into par.
    a, b : Body or ground
        The bodies; b is None for a primitive that has markers on a only.
    name : str
        What error messages call it.

    Examples
    --------
    A point of a body stays on the cylinder x^2 + y^2 = R^2:

    >>> import tsdyn as ts
    >>> class OnCylinder(ts.Primitive):
    ...     rows, markers = 1, (ts.Point("a"),)
    ...     def __init__(self, a, *, radius=1.0, **places):
    ...         super().__init__(a, None, **places)
    ...         self.radius = float(radius)
    ...     def parameters(self):
    ...         return (self.radius,)
    ...     @staticmethod
    ...     def phi(x, par, t, out):
    ...         out[0] = (x[0] * x[0] + x[1] * x[1] - par[0] * par[0]) / 2
    ...     @staticmethod
    ...     def jacobian(x, par, t, out):
    ...         out[0, 0], out[0, 1] = x[0], x[1]
    ...     @staticmethod
    ...     def gamma(x, xd, par, t, out):
    ...         out[0] = xd[0] * xd[0] + xd[1] * xd[1]
    >>> scene = ts.Scene()
    >>> bead = scene.add_point_mass(mass=1.0, position=(1, 0, 0), velocity=(0, 2, 0))
    >>> scene.add(OnCylinder(bead))
    <OnCylinder 'OnCylinder(body1)'>
    >>> ts.testing.check_primitive(OnCylinder)  # doctest: +SKIP
    """

    lacks = "constraints and has no rows"
    rows = 0
    rate_rows = 0
    all_rows = 0  # both
    slots = 0
    memory = 0
    normal = ""
    normal_at = -1  # among the markers
    summed = False
    begins_anew = False  # whether a run may begin at a state that doesn't say what it remembers
    counted: Any = ()  # (joint, index) of each angle whose turns a term counts
    others: tuple[AnyBody, ...] = ()  # bodies beyond a and b that a term of a sum reads
    others_at = 0  # their first parameter; pack() fills in three for each
    anywhere = False  # whether rows on velocities hold wherever positions are, though they could be integrated
    reach: float = 0.0  # m, the largest length of its own, such as a radius, beside the coordinates of points
    normalises = False  # whether it does no more than keep the length of p
    prescribed: str | tuple[str, ...] = ""
    kernels = MappingProxyType({})  # name -> Callback, compiled when a scene first uses the kind

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        where = f"primitive {cls.__name__}"
        for name in ("rows", "rate_rows"):
            count = getattr(cls, name)
            if isinstance(count, bool) or not isinstance(count, int) or count < 0:
                raise InvalidConstraint(f"{where}: {name} must be a number of scalar constraints, 0 or more.")
        cls.all_rows = cls.rows + cls.rate_rows
        if cls.all_rows == 0:
            raise InvalidConstraint(
                f"{where}: set rows to the number of its scalar constraints, or rate_rows to that of its constraints "
                "on velocities."
            )
        markers = cls.markers if isinstance(cls.markers, (tuple, list)) else ()
        if not markers or not all(isinstance(m, Marker) and m.code != TURN for m in markers):
            raise InvalidConstraint(f"{where}: markers must be a tuple of Point, Vector or Parameters.")
        check_slots(cls, where, InvalidConstraint)
        if getattr(cls, "series", None) is not None and any(m.code == PARAMETERS for m in markers):
            raise InvalidConstraint(f"{where}: series are for primitives on Points and Vectors only.")
        if getattr(cls, "arm_series", None) is not None:
            _check_contact(cls, where)
        if getattr(cls, "series_t", None) is not None and not cls.quantities():
            raise InvalidConstraint(f"{where}: series_t is of what is `prescribed`; name its attributes there.")
        if cls.memory < 0 or (cls.memory > 0) != (getattr(cls, "remember", None) is not None):
            raise InvalidConstraint(f"{where}: memory = 1 needs a kernel remember, and remember needs memory = 1.")
        functions = {}
        required = {**(_KERNELS if cls.rows else {}), **(_RATE_KERNELS if cls.rate_rows else {})}
        for name, arguments in {**required, **_OPTIONAL}.items():
            if name in _OPTIONAL and (getattr(cls, name, None) is None or (name == "phi_t" and not cls.rows)):
                continue
            if name == "series_t" and not ({"phi_t", "rate"} & functions.keys() and "series" in functions):
                continue  # of a subclass that has dropped one of them
            functions[name] = static_kernel(cls, name, arguments, where, InvalidConstraint)
        cls.kernels = MappingProxyType(_compile(cls, functions))
        if not cls.__name__.startswith("_"):  # a variant, which its public class makes
            _registry[f"{cls.__module__}.{cls.__qualname__}"] = cls

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an attribute, checked; a prescribed one may be a number or three functions of time."""
        if name in self.quantities():
            value = Motion.wrap(value, f"{self.name}: {name}")
        super().__setattr__(name, value)

    @property
    def parts(self) -> tuple[Primitive, ...]:
        """The primitives that it is made of: itself."""
        return (self,)

    @property
    def row_labels(self) -> tuple[str, ...]:
        """What follows its title in the names of its rows."""
        return ("",) if self.all_rows == 1 else tuple(f"[{i}]" for i in range(self.all_rows))

    @property
    def first_memory(self) -> list[float]:
        """What it remembers at first: the angles near which its joints begin to count."""
        pairs = [(np.ravel(joint.angle_near), which) for joint, which in self.counted or [(self, 0)] * self.memory]
        return [float(near[which if near.size > 1 else 0]) for near, which in pairs]

    @property
    def rheonomic(self) -> bool:
        """True if the constraint depends on time."""
        if self.rate_rows:
            return self._drifts() or (self.rows > 0 and getattr(self, "phi_t", None) is not None and self._moves())
        return "phi_t" in self.kernels and self._moves()

    def _moves(self):
        """Whether what is prescribed is a function of time; true where nothing is."""
        names = self.quantities()
        return not names or any([isinstance(getattr(self, name), Motion) for name in names])

    def _drifts(self):
        """Whether b, the rate at xd = 0, may be other than zero, with these or other numbers: asked at random ones."""
        given, rng = self.parameters(), np.random.default_rng(0)
        if any(isinstance(value, Motion) for value in given):
            return True
        out, par = np.zeros(self.rate_rows), np.array([*given, *[0.0] * self.memory]) + rng.uniform(0.1, 1.0)
        for _ in range(3):
            x = [rng.normal(size=marker.size) for marker in self.markers]
            for part, marker in zip(x, self.markers, strict=True):  # directions of unit length
                part /= 1.0 if marker.code == POINT else np.linalg.norm(part)
            x = np.concatenate(x)
            with np.errstate(all="ignore"):
                twin(self.rate)(x, np.zeros(x.size), par, rng.uniform(0.1, 2.0), out)
            if np.nan_to_num(out).any():
                return True
        return False

    @classmethod
    def quantities(cls) -> tuple[str, ...]:
        """The names of what is prescribed."""
        return (cls.prescribed,) * bool(cls.prescribed) if isinstance(cls.prescribed, str) else cls.prescribed

    @classmethod
    def example(cls, rng: Random, a: AnyBody, b: AnyBody) -> Self:
        """Return a random valid instance between two bodies, for tests."""
        places = {m.argument: rng.normal(size=3) for m in cls.markers if m.code != PARAMETERS}
        return cls(a, b, **places) if any(m.body == "b" for m in cls.markers) else cls(a, **places)


def _check_contact(cls, where):
    """Refuse arms of what is no contact, as the module's docstring has it."""
    places, sides = [marker.argument for marker in cls.markers], [marker.body for marker in cls.markers]
    at = places.index(cls.normal) if cls.normal in places else 0
    along = [marker.code for marker in cls.markers[at:][: cls.all_rows]]
    if (
        [marker.code for marker in cls.markers[:4]] != [POINT, VECTOR, VECTOR, VECTOR]
        or sides[:4] != ["a"] * 4
        or not cls.rows == 1
        or not (at > 4 and cls.markers[at - 1].code == POINT and along == [VECTOR] * cls.all_rows)
        or "a" in sides[at - 1 :]
    ):
        raise InvalidConstraint(
            f"{where}: arm_series needs markers in this order: a Point and three Vectors of a, then a Point of b, the "
            "Vector of b that `normal` names, and one for each further row."
        )


def registered() -> Mapping[str, type[Primitive]]:
    """Return every primitive class known, built in or plugged in, by its full name."""
    return MappingProxyType(_registry)


_LOOPS = {  # name: template, whose kernel it is cached with, signature
    "phi": (coordinate_rows.values, "phi", coordinate_rows.SIGNATURE),
    "phi_t": (coordinate_rows.values, "phi_t", coordinate_rows.SIGNATURE),
    "jacobian": (coordinate_rows.jacobian, "jacobian", coordinate_rows.SIGNATURE),
    "gamma": (coordinate_rows.bias, "gamma", coordinate_rows.SIGNATURE),
    "remember": (coordinate_rows.remembers, "remember", coordinate_rows.SIGNATURE),
    "stiffness": (constraint_hessians.geometric_stiffness, "jacobian", constraint_hessians.STIFFNESS),
    "slopes": (constraint_hessians.rate_slopes, "gamma", constraint_hessians.SLOPES),
    "values": (constraint_rows.values, "phi", constraint_rows.SIGNATURE),
    "drift": (constraint_rows.values, "phi_t", constraint_rows.SIGNATURE),
    "reduced": (constraint_rows.reduced, "jacobian", constraint_rows.SIGNATURE),
    "bias": (constraint_rows.bias, "gamma", constraint_rows.SIGNATURE),
    "series": (constraint_series.series, "series", constraint_series.SIGNATURE),
    "far_series": (constraint_series.series, "series", constraint_series.SIGNATURE),
    "contact_rows": (ground_contacts.reduced, "arm_series", constraint_rows.SIGNATURE),
    "contact_series": (ground_contacts.series, "arm_series", constraint_series.SIGNATURE),
    "driven_series": (constraint_series.series, "series_t", constraint_series.SIGNATURE),
    "far_driven_series": (constraint_series.series, "series_t", constraint_series.SIGNATURE),
}


def _compile(cls, functions):
    """Make the callbacks of a kind: each runs over all its instances."""
    try:
        inner = {f"kernel_{name}": inlined(function) for name, function in functions.items()}
    except InvalidConstraint as error:
        raise InvalidConstraint(f"primitive {cls.__name__}: {error}") from error
    constants = {"ROWS": cls.all_rows, "RATES_FROM": cls.rows, "SUMMED": cls.summed, "kernel_drift": rate_rows.nothing}
    places = [marker.argument for marker in cls.markers]
    constants["NORMAL"] = cls.normal_at = places.index(cls.normal) if cls.normal else -1
    constants |= layout(cls.markers) | inner | {"OTHERS_AT": cls.others_at}
    if cls.rate_rows:
        # One kernel of both sorts of rows in place of each
        names = {**rate_rows.NOTHING, **constants}
        functions = functions | {
            name: specialised(template, f"{cls.__qualname__}.{name}", _python(functions["rate"]), **names)
            for name, template in rate_rows.KERNELS.items()
        }
        constants |= {f"kernel_{name}": inlined(functions[name]) for name in rate_rows.KERNELS}
        constants["kernel_drift"] = constants["kernel_phi_t"]
        inner = constants
    result = {}
    for name, (template, whose, signature) in _LOOPS.items():
        if whose in functions:
            owner, driven = _python(functions[whose]), whose == "series_t"
            names = {
                **constants,
                "kernel_value": inner[f"kernel_{whose}"],
                "SLOTS": cls.slots + (len(cls.quantities()) if driven else 0),
                "AHEAD": name.startswith("far"),
                "DRIVEN": driven,
            }
            names.setdefault("kernel_series_t", names.get("kernel_series"))
            result[name] = Callback(specialised(template, f"{cls.__qualname__}.{name}_loop", owner, **names), signature)
    return result


def _python(function):
    """A function that may be a kernel already, as it was written."""
    return getattr(function, "py_func", function)
