"""The checks of `series` against truncated Taylor arithmetic, on instances in scenes of two random bodies."""

import numpy as np

from ..elements.force import Force
from ..elements.joint import Joint, SumRow
from ..elements.loops.constraint_rows import POSE, P
from ..elements.loops.constraint_series import ADVANCE, BODY_ROW, RESIDUAL, S_OMEGA, S_R
from ..elements.loops.template import state
from ..elements.markers import PARAMETERS, POINT, TURN
from ..elements.primitive import Primitive
from ..errors import CheckFailed, InvalidArgument
from ..jit.kernels import entry, resident, twin
from ..maths.power_series import Truncated
from ..maths.vectors import rotate
from ..methods.integrator import Integrator
from ..model.equations import set_time
from ..model.packed import member_of
from ..motions.prescribed import Motion
from ..motions.signals import Signal, numbers_of
from ..motions.tracing import retold
from ..observables.diagnostics import starts_of
from ..rows.constraint_graph import build
from ..rows.interface import allocate_tangent
from ..simulation.scene import Scene
from ..taylor.coefficients import run_forces, run_loops
from ..taylor.layout import SeriesContext, Trial, allocate_expansion, load_series, masks, no_series
from ..taylor.step_parts import expand_motions
from ..workspaces import plain_work
from .tolerances import ORDER, ROUNDED, SHRINK

# Instances of a class of constraints or forces in scenes of two bodies that move at random.

ARRANGEMENTS = ("body to body", "body to ground", "ground to body")
CHECKS = {Primitive: "check_primitive", Joint: "check_primitive", Force: "check_force", Integrator: "check_integrator"}


def demand_kind(item, bases):
    """Refuse a class or an instance that another check is for."""
    kind = item if isinstance(item, type) else type(item)
    for base, check in CHECKS.items():
        if issubclass(kind, base) and not issubclass(kind, bases):
            raise InvalidArgument(
                f"{kind.__name__} is a subclass of ts.{base.__name__}: use ts.testing.{check}({kind.__name__})."
            )


def maker(kind, bases, error, example):
    """Make the `make` of `instances`: of a class by example(a, b), or a callable (a, b)."""
    demand_kind(kind, bases)

    def make(a, b, alone):
        if isinstance(kind, type) and issubclass(kind, bases):
            single = not any(marker.body == "b" for marker in kind.markers)
            return None if single and alone else example(a, b)
        if not callable(kind):
            raise InvalidArgument(
                f"a check needs a {bases[0].__name__} class or a callable (a, b) that makes one, got {kind!r}."
            )
        try:
            made = kind(a, b)
        except error:
            if alone:
                return None
            raise
        demand_kind(made, bases)
        if not isinstance(made, bases):
            raise InvalidArgument(f"a check needs what makes a {bases[0].__name__}; {kind!r} made {made!r}.")
        return None if alone and made.b is None else made

    return make


def instances(make, rng, states):
    """Yield (scene, instance, arrangement); make(a, b, alone) returns None for an arrangement without meaning.

    alone is True if one of a and b is the ground.
    """
    for arrangement in ARRANGEMENTS:
        for _ in range(states):
            scene = Scene()
            one, two = (_body(scene, rng, name) for name in ("one", "two"))
            a = scene.ground if arrangement == "ground to body" else one
            b = scene.ground if arrangement == "body to ground" else two
            instance = make(a, b, arrangement != "body to body")
            if instance is not None:
                yield scene, scene.add(instance), arrangement


def _body(scene, rng, name):
    r, p = rng.normal(size=3), rng.normal(size=4)
    return scene.add_body(1.0, (1.0, 1.1, 1.2), position=r, orientation=p / np.linalg.norm(p), name=name)


# The checks of `series` in `check_primitive` and `check_force`, against truncated Taylor arithmetic.
#
# The bodies perform random analytic motions. Along them phi, its jacobian or the law, evaluated on truncated series,
# give the coefficients that `series` must return: first for the Python kernel, order by order, then for the compiled
# loops.

_AXES = ("x", "y", "z")


@entry
def constraint_coefficients(context, k):
    """b = (k + 1)(k + 2) Phi_{k+2} from the bodies' series; k in turn from zero."""
    c = load_series(context)
    for i in range(c.tangent.b.size):
        c.tangent.b[i] = 0.0  # the multipliers
    run_loops(c.graph, c.system.reals, ADVANCE, k, c.expansion, c.tangent)
    run_loops(c.graph, c.system.reals, RESIDUAL, k, c.expansion, c.tangent)


@entry
def begin_motions(context, t):
    """The series of all motions about t."""
    c = load_series(context)
    set_time(c.system, t)
    c.expansion.order.time = t
    expand_motions(c.system, c.expansion)


@entry
def force_coefficients(context, k):
    """Z ((b + 1) 8,) = order k of the forces and body torques; k in turn from zero."""
    c = load_series(context)
    for i in range(c.tangent.Z.size):
        c.tangent.Z[i] = 0.0
    run_forces(c.system.reals, c.expansion, k, c.tangent)


def series_context(packed, graph, kinds):
    """A `SeriesContext` of orders up to ORDER, and what its kernels find it by."""
    n, system = int(packed.system.bodies[:, 1].sum()), packed.system._replace(reals=packed.system.reals.copy())
    expansion, tangent = allocate_expansion(graph, kinds, packed, ORDER), allocate_tangent(graph, n)
    context = SeriesContext(system, plain_work(n), graph, tangent, expansion, Trial())
    return context, resident(context)


def check_constraint_series(scene, constraint, name, rng):
    """Check the `series` of a primitive, or of a joint's parts, if it has one that a run would use."""
    parts = constraint.parts
    if any("series" not in part.kernels for part in parts):
        return
    moved = [part for part in parts if any(isinstance(value, Motion) for value in part.parameters())]
    if any("driven_series" not in part.kernels for part in moved):
        return
    if any(isinstance(p, Motion) and p.smooth is None for part in moved for p in part.parameters()):
        return
    q, t = random_motion(scene, rng), random_time(rng)
    found = [_check_rows(scene, part, name, q, t) for part in parts]
    Phi = sum(found) if isinstance(constraint, SumRow) else np.concatenate(found)
    packed = scene.packed
    own, (graph, kinds) = member_of(packed, constraint).rows, build(packed)
    places = np.flatnonzero((graph.row >= own.start) & (graph.row < own.stop))
    Phi = Phi[graph.row[places] - own.start]
    masks(graph, packed)
    context, (where, *_keep) = series_context(packed, graph, kinds)
    write_bodies(scene, q, context.expansion)
    begin_motions(where, t.c[0])
    for k in range(ORDER - 1):
        constraint_coefficients(where, k)
        value = context.tangent.b[places] / ((k + 1) * (k + 2))
        compare(name, k + 2, [f"compiled Phi[{i}]" for i in graph.row[places]], value, Phi)


def _check_rows(scene, primitive, name, q, t):
    """Check the Python `series` of a primitive along a motion q; return Phi (rows,) as Truncated series."""
    kind, given = type(primitive), primitive.parameters()
    par = [entry for value in given for entry in _entries(value, t)] + [0.0] * kind.memory
    numbers = [entry.c[0] if isinstance(entry, Truncated) else entry for entry in par]
    rows = [_series(par[3 * i]).c for i in range(len(kind.quantities()) if "driven_series" in kind.kernels else 0)]
    x, xd = along(scene, primitive, primitive.coordinates, q)
    m = kind.all_rows
    Phi, Phi_x, Phi_t, columns = zeros(m), zeros((m, len(x))), zeros(m), labels_of(kind)
    labels = [[f"jacobian[{i}, {j}] (d phi[{i}] / d {c})" for j, c in enumerate(columns)] for i in range(kind.rows)]
    if kind.rows:
        run_truncated(kind, "phi", name, x, par, t, Phi)
        run_truncated(kind, "jacobian", name, x, par, t, Phi_x)
        if rows and getattr(kind, "phi_t", None):
            run_truncated(kind, "phi_t", name, x, par, t, Phi_t)
    if kind.rate_rows:
        # A, b, and for Phi the integral of the rate
        labels += [
            [f"rate_jacobian[{i}, {j}] (d rate[{i}] / d rate of {c})" for j, c in enumerate(columns)]
            for i in range(kind.rate_rows)
        ]
        rates = zeros(kind.rate_rows)
        run_truncated(kind, "rate_jacobian", name, x, par, t, Phi_x[kind.rows :])
        run_truncated(kind, "rate", name, x, zeros(len(x)), par, t, Phi_t[kind.rows :])
        run_truncated(kind, "rate", name, x, xd, par, t, rates)
        Phi[kind.rows :] = [t.of(rate).integral(0.0) for rate in rates]
    moving = np.repeat([primitive.body_of(marker).dimension > 0 for marker in kind.markers], [3] * len(kind.markers))
    labels = np.array(labels, object)[:, moving]  # columns of the ground are used by nobody
    for k, f, scratch in coefficients_of(kind, name, (x,), numbers, (m, len(x)), rows):
        compare(name, k, labels, f[:, moving], Phi_x[:, moving])
        if rows:
            drift = np.zeros(m)
            twin(kind.series_t)(np.array([c.c[k] for c in x]), numbers, k, scratch, drift)
            compare(name, k, [f"phi_t[{i}], by series_t," for i in range(m)], drift, Phi_t)
    return Phi


def _entries(value, t):
    """A parameter as phi has it: a Motion is its series, and those of its rate and acceleration."""
    if not isinstance(value, Motion):
        return (value,)
    f = t.of(value.smooth(t))
    return f, f.rate, f.rate.rate


def check_force_series(scene, force, name, rng):
    """Check a force's `series`, if it has one that a run would use."""
    packed = scene.packed
    (load,), kind = packed.loads, type(force)
    if load.law is not None or no_series(force, load.parameters):
        return
    q, t = random_motion(scene, rng), random_time(rng, 0.8)
    x, xd = along(scene, force, load.coordinates, q)
    par = [number for value in load.parameters for number in _numbers(value, t)]
    par += [*rng.normal(scale=10.0, size=force.memory)]
    f = zeros(len(x))
    if hasattr(force.kernels, "program"):
        _law_of(force)(x, xd, par, t, f)
    else:
        run_truncated(kind, "law", name, x, xd, par, t, f)
        numbers = [_series(number).c[0] for number in par]
        driven = any(isinstance(value, Signal) for value in load.parameters)
        rows, what = ([_series(number).c for number in par], "driven_series") if driven else ((), "series")
        labels = [f"out[{j}] (conjugate to {c})" for j, c in enumerate(labels_of(kind))]
        for k, out, _ in coefficients_of(kind, name, (x, xd), numbers, (len(x),), rows, what):
            compare(name, k, labels, out, f)

    graph, kinds = build(packed)
    context, (where, *_keep) = series_context(packed, graph, kinds)
    context.tangent.poses[:] = write_bodies(scene, q, context.expansion).ravel()
    context.system.reals[packed.system.memory] = par[len(par) - force.memory :]
    begin_motions(where, t.c[0])
    expected = carried_back(scene, load, q, f)
    labels = [f"{what} {axis} of {b.name}" for b in scene.bodies for what in ("force", "body torque") for axis in _AXES]
    for k in range(ORDER):
        force_coefficients(where, k)
        got = context.tangent.Z.reshape(-1, 2, 4)[:-1, :, :3].ravel()
        compare(name, k, [f"compiled {label}" for label in labels], got, expected)


def _numbers(value, t):
    """A parameter as the law has it: of a Signal its series."""
    return [t.of(motion(t)) for motion in value.smooth] if isinstance(value, Signal) else (value,)


def _law_of(force):
    """The law of a force that is given by a user's function, for any numbers."""
    function = force.function_of_state
    plain = getattr(function, "py_func", function)
    told, names = retold(plain), list(numbers_of(plain))

    def call(*given):
        *arguments, par = given
        return told(*arguments, **dict(zip(names, par[force.begin :], strict=False)))

    others = {"make": lambda f: f, "stack": zeros, "float": lambda number: number}
    return twin(force._wrap(told if force.has_numbers else call, plain, **others))


def random_motion(scene, rng):
    """q (n,) of a scene of rigid bodies as Truncated series, p.p = 1; they begin where the bodies are."""
    weights = SHRINK ** np.arange(ORDER + 2)
    q = []
    for body in scene.bodies:
        series = [
            Truncated(np.append(v, rng.normal(size=ORDER + 1)) * weights) for v in (*body.position, *body.orientation)
        ]
        p = series[3:]
        length = np.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
        q += [*series[:3], *(e / length for e in p)]
    return objects(q)


def along(scene, attachment, coordinates, q):
    """x and xd of an attachment's markers as Truncated series."""
    starts, qd = starts_of(scene.packed), objects([c.rate for c in q])
    x, xd = [], []
    for marker, s in zip(attachment.markers, coordinates, strict=True):
        body, place, rate = attachment.body_of(marker), zeros(marker.size), zeros(marker.size)
        twin(state)(marker.code, body.dimension, starts.get(body, 0), q, qd, s, place, rate)
        x += [q[0].of(c) for c in place]
        xd += [q[0].of(c) for c in rate]
    return objects(x), objects(xd)


def write_bodies(scene, q, expansion):
    """Write the bodies' series into an Expansion; return the poses ((b + 1) * POSE,) at order zero."""
    orders, known = int(expansion.order.room), q[0].c.size
    poses = np.zeros((len(scene.bodies) + 1, POSE))
    poses[:, P] = 1.0
    for b, row in enumerate(expansion.bodies.reshape(-1, BODY_ROW * orders)[:-1]):
        r, p = q[7 * b : 7 * b + 3], q[7 * b + 3 : 7 * b + 7]
        A = row[: 12 * orders].reshape(orders, 3, 4)
        for c, column in enumerate(_columns(p)):
            A[:known, c, :3] = np.transpose([entry.c for entry in column])
        for first, vector in ((S_R, r), (S_OMEGA, _omega(p))):
            part = row[first * orders : (first + 4) * orders].reshape(orders, 4)
            part[:known, :3] = np.transpose([entry.c for entry in vector])
        poses[b, P : P + 4] = [entry.c[0] for entry in p]
    return poses.ravel()


def _columns(p):
    """The columns of A(p)."""
    columns = [zeros(3) for _ in range(3)]
    for column, axis in zip(columns, np.eye(3), strict=True):
        twin(rotate)(p, axis, column)
    return columns


def _omega(p):
    """omega' = 2 G(p) pd."""
    e0, e1, e2, e3 = p
    d0, d1, d2, d3 = (e.rate for e in p)
    return [
        2.0 * (e0 * d1 - e1 * d0 + e3 * d2 - e2 * d3),
        2.0 * (e0 * d2 - e2 * d0 - e3 * d1 + e1 * d3),
        2.0 * (e0 * d3 - e3 * d0 + e2 * d1 - e1 * d2),
    ]


def carried_back(scene, load, q, f):
    """Forces and body torques about the centroids that a force's f is to each body, (b, 6) series in a row."""
    total, at = zeros((len(scene.bodies), 2, 3)), 0
    for marker, s in zip(load.force.markers, load.coordinates, strict=True):
        part, body = f[at : at + marker.size], load.force.body_of(marker)
        at += marker.size
        if body.dimension == 0:
            continue
        p, (force, torque) = q[7 * body.index + 3 : 7 * body.index + 7], total[body.index]
        if marker.code == PARAMETERS:
            e0, e1, e2, e3 = p
            f0, f1, f2, f3 = part
            torque[0] += 0.5 * (e0 * f1 - e1 * f0 + e3 * f2 - e2 * f3)
            torque[1] += 0.5 * (e0 * f2 - e2 * f0 - e3 * f1 + e1 * f3)
            torque[2] += 0.5 * (e0 * f3 - e3 * f0 + e2 * f1 - e1 * f2)
            continue
        y = objects([sum(a * b for a, b in zip(column, part, strict=True)) for column in _columns(p)])
        if marker.code == POINT:
            force += part
        torque += y if marker.code == TURN else np.cross(s, y)
    return total.ravel()


def coefficients_of(kind, name, coordinates, par, shape, rows=(), what="series"):
    """Yield k, what the Python `series` writes, and its scratch, which holds nothing yet but the rows prescribed."""
    scratch, series = np.full((kind.slots + len(rows), ORDER + 2), np.nan), twin(getattr(kind, what))
    for i, row in enumerate(rows):
        scratch[kind.slots + i] = row
    for k in range(ORDER + 1):
        out = np.zeros(shape)
        try:
            series(*(np.array([c.c[k] for c in part]) for part in coordinates), par, k, scratch, out)
        except IndexError as error:
            raise CheckFailed(
                f"{name}: series writes outside its arrays ({error}); scratch has slots = {kind.slots} rows, and a "
                "coefficient up to k in each."
            ) from error
        yield k, out, scratch


def run_truncated(kind, what, name, *arguments):
    """Run a kernel on truncated series."""
    try:
        twin(getattr(kind, what))(*arguments)
    except TypeError as error:
        raise CheckFailed(
            f"{name}: {what} can't be run on truncated Taylor series ({error}), so its series can't be checked; use "
            "arithmetic and NumPy functions, and no comparison, abs or norm of x."
        ) from error


def labels_of(kind):
    """What the coordinates of a kind's markers are called."""
    return [
        f"{m.argument}, component {_AXES[i] if m.size == 3 else f'e{i}'}" for m in kind.markers for i in range(m.size)
    ]


def compare(name, k, labels, got, expected):
    """Coefficient k of each against those of series; all of one shape."""
    scale = max(1.0, *(np.abs(_series(e).c[: k + 1]).max() for e in np.ravel(expected)))
    for label, value, series in zip(np.ravel(labels), np.ravel(got), np.ravel(expected), strict=True):
        right = _series(series).c[k]
        if not abs(value - right) <= ROUNDED * scale:
            raise CheckFailed(f"{name}: series: coefficient {k} of {label} is {value:.15g} and should be {right:.15g}.")


def _series(value):
    return value if isinstance(value, Truncated) else Truncated([value, *[0.0] * (ORDER + 1)])


def random_time(rng, last=2.0):
    """The time t as a Truncated series."""
    return Truncated([rng.uniform(0.1, last), 1.0, *[0.0] * ORDER])


def zeros(shape):
    """Zeros that may become series."""
    return np.full(shape, 0.0, dtype=object)


def objects(entries):
    """An array (k,) of series."""
    result = np.empty(len(entries), object)
    result[:] = entries
    return result
