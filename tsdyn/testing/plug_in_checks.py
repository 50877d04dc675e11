"""Checks of plug-ins, constraints and forces, for their authors and for the project's tests."""

from __future__ import annotations

import warnings
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ..elements.force import Force
from ..elements.joint import Joint
from ..elements.primitive import Primitive
from ..errors import CheckFailed, InvalidCall, InvalidForce, TsdynError
from ..jit.kernels import NumbaError, entry, twin
from ..maths.power_series import Jet, Truncated
from ..maths.tolerances import COMPLEX_STEP
from ..model.equations import applied_forces, force_jacobian, set_time, with_force_jacobians
from ..model.packed import member_of
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..observables.diagnostics import constraint_rows, load_powers, marker_states
from ..observables.evaluate import constraint_arrays
from ..observables.generalised_forces import force_loads
from ..rows.constraint_graph import build
from ..taylor.layout import no_series
from . import series_checks
from .tolerances import DRAWN, NOT_ANALYTIC, ORDER, QUOTIENT, REAL_STEP, ROUNDED, SHRINK, SPACING

if TYPE_CHECKING:
    from ..hints import AnyBody, Callable

NOT_HOLONOMIC = (
    " A row on velocities that is the rate of no phi is not holonomic: make it one of rate_rows, with the kernels "
    "rate, rate_jacobian and rate_gamma."
)
_AXES = "xyz"
WITH_VELOCITIES = "gamma", "rate", "rate_gamma"  # kernels that are given xd


def check_primitive(
    kind: type[Primitive | Joint] | Callable[[AnyBody, AnyBody], Primitive | Joint], *, seed: int = 0, states: int = 3
) -> None:
    """Check a primitive's kernels against complex steps of its phi and its rate; return None, or name the wrong entry.

    Parameters
    ----------
    kind : Primitive or Joint subclass, or callable (a, b) -> Primitive or Joint
        Of a joint every part is checked, then all together. A class is checked with its `example(rng, a, b)`.
        Primitives that have markers on a only get b too and may ignore it. The kernels of a primitive that has no
        `example` of its own are checked with its parameters changed at random, too: defaults hide errors.
    seed : int
        Of the random states.
    states : int
        Number of random, fast-turning states for each arrangement: body to body, body to ground, ground to body.

    Raises
    ------
    CheckFailed
        If an entry of jacobian, phi_t or gamma, or of the assembled Phi_q, Phi_t or gamma, is not the derivative that
        it should be, the compiled kernel differs from the Python one, or a kernel compares or leaves its arrays. A row
        whose jacobian is of no phi is not holonomic, and refused too; so is a rate that is not linear in velocities.

    Warns
    -----
    UserWarning
        If a row on velocities is the derivative of a function of positions, which belongs in phi.

    Notes
    -----
    jacobian is compared with Phi_x by complex steps in x, phi_t with Phi_t by complex steps in t (motions with
    difference quotients of the complex-step kind too), gamma with the complex step of Phi_x xd + Phi_t along (xd, 1):
    (Phi_x xd)_x xd + 2 Phi_xt xd + Phi_tt (Haug 2018, Eq. 3). rate_jacobian is compared with the complex steps of rate
    in xd, rate_gamma with that of rate along (x, t) = (xd, 1). Then the compiled, assembled arrays are compared with
    phi carried along the motion as a truncated Taylor series, which uses neither jacobian nor gamma.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.testing.check_primitive(ts.constraints.Distance, states=1)
    """
    rng = np.random.default_rng(seed)
    make = series_checks.maker(kind, (Primitive, Joint), TsdynError, lambda a, b: _example(kind, rng, a, b))
    for scene, constraint, arrangement in series_checks.instances(make, rng, states):
        name = f"{type(constraint).__name__} ({arrangement})"
        for part in constraint.parts:
            if part.others:  # a share of a function's derivatives: it counts in the sum, which is assembled
                continue
            own = name if part is constraint else f"{type(part).__name__} in {name}"
            _check_kernels(part, own, rng, part.parameters())
            if type(part).example.__func__ is Primitive.example.__func__:
                _check_perturbed(part, own, rng)
        _check_assembled(scene, constraint, name, rng)
        series_checks.check_constraint_series(scene, constraint, name, rng)


def _example(kind, rng, a, b):
    try:
        return kind.example(rng, a, b)
    except InvalidCall as error:
        raise CheckFailed(
            f"{kind.__name__}: no example could be made ({error}); give the argument a default, or write a classmethod "
            "example(cls, rng, a, b) that returns a random valid instance."
        ) from error


def _check_perturbed(constraint, name, rng):
    """The kernels with other numbers as par: where they are defaults such as 1, a power of them isn't seen."""
    timed = "phi_t" in type(constraint).kernels  # zeros may be the rates of what stands still
    par = [
        p if isinstance(p, Motion) or (timed and p == 0.0) else p * rng.uniform(0.5, 2.0) if p else rng.normal()
        for p in constraint.parameters()
    ]
    if par == list(constraint.parameters()):
        return
    try:
        _check_kernels(constraint, name, rng, par)
    except CheckFailed as error:
        numbers = ", ".join("a motion" if isinstance(p, Motion) else f"{p:.6g}" for p in par)
        raise CheckFailed(
            f"{error} This is with par = ({numbers}), changed at random; where such parameters can't be, write a "
            "classmethod example(cls, rng, a, b) that returns a random valid instance."
        ) from error


def _check_kernels(constraint, name, rng, par):
    kind, size = type(constraint), sum(m.size for m in constraint.markers)
    x, xd, t = rng.normal(size=size), 10.0 * rng.normal(size=size), rng.uniform(0.1, 2.0)
    written = [kernel for kernel in ("phi", "jacobian", "gamma", "phi_t") if kind.rows and getattr(kind, kernel, None)]
    rates = ["rate", "rate_jacobian", "rate_gamma"] if kind.rate_rows else []
    f = SimpleNamespace(**{kernel: _python(constraint, kernel, name, par) for kernel in (*written, *rates)})
    for kernel in written:
        _demand_no_comparison(getattr(f, kernel), kernel, name, kind.rows, x, xd, t)
    for kernel in rates:
        _demand_no_comparison(getattr(f, kernel), kernel, name, kind.rate_rows, x, xd, t)
    # entries are named by the argument that places their marker
    labels = [
        f"{m.argument}, component {_AXES[i] if m.size == 3 else f'e{i}'}" for m in kind.markers for i in range(m.size)
    ]
    if kind.rows:
        _check_positions(f, name, kind.rows, (x, xd, t), labels)
    if kind.rate_rows:
        f.anywhere = kind.anywhere
        _check_rates(f, name, kind.rate_rows, (x, xd, t), labels)


def _check_positions(f, name, rows, motion, labels):
    """jacobian, phi_t and gamma against phi."""
    x, xd, t = motion
    size = x.size
    Phi_x = np.zeros((rows, size))
    f.jacobian(x, t, Phi_x)
    fixed = _vector(f.phi, rows, x, t) == _vector(f.phi, rows, x + xd, t)
    for j in range(size):
        step = np.zeros(size, complex)
        step[j] = 1j * COMPLEX_STEP
        expected = _vector(f.phi, rows, x + step, t).imag / COMPLEX_STEP
        h = REAL_STEP * step.imag / COMPLEX_STEP
        quotient = (_vector(f.phi, rows, x + h, t) - _vector(f.phi, rows, x - h, t)).real / (2.0 * REAL_STEP)
        if not np.allclose(quotient, expected, rtol=NOT_ANALYTIC, atol=NOT_ANALYTIC * (1.0 + np.abs(Phi_x).max())):
            raise CheckFailed(
                f"{name}: phi is not analytic, so its complex steps say nothing: it compares, or takes abs or norm of, "
                "x. Write np.sqrt(x[0] ** 2 + ...) for a norm."
            )
        for i in range(rows):
            entry = f"jacobian[{i}, {j}] (d phi[{i}] / d {labels[j]})"
            _compare(name, entry, Phi_x[i, j], expected[i], Phi_x, NOT_HOLONOMIC if fixed[i] else "")

    expected = _vector(f.phi, rows, x, t + 1j * COMPLEX_STEP).imag / COMPLEX_STEP
    if hasattr(f, "phi_t"):
        Phi_t = _vector(f.phi_t, rows, x, t)
        for i in range(rows):
            _compare(name, f"phi_t[{i}]", Phi_t[i], expected[i], expected)
    elif expected.any():
        raise CheckFailed(
            f"{name}: phi depends on the time, d phi / dt = {expected}, but there is no phi_t; write one."
        )

    def rate(s):
        jacobian = np.zeros((rows, size), complex)
        f.jacobian(x + s * xd, t + s, jacobian)
        total = jacobian @ xd
        return total + _vector(f.phi_t, rows, x + s * xd, t + s) if hasattr(f, "phi_t") else total

    expected = rate(1j * COMPLEX_STEP).imag / COMPLEX_STEP
    gamma = _vector(f.gamma, rows, x, t, xd).real
    scale = np.abs(np.abs(Phi_x) @ xd**2)
    for i in range(rows):
        _compare(name, f"gamma[{i}]", gamma[i], expected[i], scale)


def _check_rates(f, name, rows, motion, labels):
    """Whether rate is linear in xd; rate_jacobian and rate_gamma against it."""
    x, xd, t = motion
    size, step = x.size, 1j * COMPLEX_STEP

    def rate(xd, x=x, t=t):
        return _vector(f.rate, rows, x, t, xd)

    # rate(xd) - rate(0) doubles with xd
    b, A = rate(0.0 * xd).real, np.zeros((rows, size))
    f.rate_jacobian(x, t, A)
    once, twice, terms = rate(xd).real - b, rate(2.0 * xd).real - b, np.abs(A) @ np.abs(xd) + np.abs(b)
    for i in range(rows):
        if not abs(twice[i] - 2.0 * once[i]) <= ROUNDED * max(1.0, terms[i], abs(twice[i])):
            raise CheckFailed(
                f"{name}: rate[{i}] is not linear in xd: twice the velocities make it {twice[i]:.6g} in place of "
                f"{2.0 * once[i]:.6g}. A row on velocities is A(x, t) xd + b(x, t)."
            )
    slopes, drifts = np.empty((size, rows, size)), np.empty((rows, size))  # A_x, b_x
    for j in range(size):
        unit = np.zeros(size, complex)
        unit[j] = step
        expected = rate(xd + unit).imag / COMPLEX_STEP
        for i in range(rows):
            _compare(name, f"rate_jacobian[{i}, {j}] (d rate[{i}] / d rate of {labels[j]})", A[i, j], expected[i], A)
        near = np.zeros((rows, size), complex)
        f.rate_jacobian(x + unit, t, near)
        slopes[j], drifts[:, j] = near.imag / COMPLEX_STEP, rate(0.0 * xd, x + unit).imag / COMPLEX_STEP
    # Along (xd, 1): (A xd)_x xd + A_t xd + b_x xd + b_t
    expected = rate(xd, x + step * xd, t + step).imag / COMPLEX_STEP
    gamma = _vector(f.rate_gamma, rows, x, t, xd).real
    for i in range(rows):
        _compare(name, f"rate_gamma[{i}]", gamma[i], expected[i], np.abs(A) @ xd**2)
    # A dx + b dt is exact where A_x is symmetric and A_t = b_x
    later = np.zeros((rows, size), complex)
    f.rate_jacobian(x, t + step, later)
    curl = np.abs(slopes - slopes.transpose(2, 1, 0)).max(axis=(0, 2))
    curl = np.maximum(curl, np.abs(later.imag / COMPLEX_STEP - drifts).max(axis=1)) + f.anywhere
    for i in np.flatnonzero(curl <= ROUNDED * np.maximum(1.0, np.abs(slopes).max(axis=(0, 2)))):
        warnings.warn(
            f"{name}: rate[{i}] is the derivative of a function of positions. Write that function as a row of phi: "
            "positions then hold to rounding, too, in place of drifting by what velocities lack.",
            UserWarning,
            stacklevel=4,
        )


def _python(constraint, kernel, name, given):
    """The kernel as a Python function of (x, t, out), or (x, t, out, xd), with par filled in."""
    plain = twin(getattr(type(constraint), kernel))

    def call(x, t, out, *xd):
        par = [part for value in given for part in _parts(value, t)] + [0.0] * constraint.memory
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", np.exceptions.ComplexWarning)
                plain(x, *xd, par, t, out)
        except (TypeError, np.exceptions.ComplexWarning) as error:
            raise CheckFailed(
                f"{name}: {kernel} can't be run on complex numbers ({error}); use arithmetic and NumPy functions "
                "(np.sin, not math.sin), and no comparison, abs or norm of x."
            ) from error
        except IndexError as error:
            raise CheckFailed(
                f"{name}: {kernel} reads or writes outside its arrays ({error}): x has {len(x)} entries, par, which is "
                f"what parameters() returns, has {len(par)}, and out the shape {np.shape(out)}."
            ) from error
        except ArithmeticError as error:
            raise CheckFailed(f"{name}: {kernel} raises {type(error).__name__} at a random x: {error}.") from error

    return call


def _demand_no_comparison(function, kernel, name, rows, x, xd, t):
    """Refuse a kernel that compares x or xd, or takes its absolute value: Jets have no order."""
    x, xd = ([Jet(value) for value in part] for part in (x, xd))
    out = np.full((rows, len(x)) if "jacobian" in kernel else rows, 0.0, object)
    try:
        function(x, t, out, *([xd] if kernel in WITH_VELOCITIES else []))
    except NumbaError:
        return  # compiled kernels that a closure calls take numbers alone
    except CheckFailed as error:
        reason = str(error.__cause__)
        if "not supported between instances" in reason or "for abs()" in reason:
            raise CheckFailed(
                f"{name}: {kernel} is not analytic: it compares x, or takes its absolute value ({reason}); a kernel "
                "goes through the same smooth formulas for every x, with np.sqrt(x[0] ** 2 + ...) for a norm."
            ) from error


def _parts(value, t):
    return [f(t) for f in value.functions] if isinstance(value, Motion) else [value]


def _vector(function, rows, x, t, *xd):
    out = np.zeros(rows, complex)
    function(x, t, out, *xd)
    return out


def _check_assembled(scene, constraint, name, rng):
    q, qd = scene.start
    t = rng.uniform(0.1, 2.0)
    for body in scene.bodies:
        body.angular_velocity, body.velocity = 10.0 * rng.normal(size=3), rng.normal(size=3)
    _, qd = scene.start
    rows = member_of(scene.packed, constraint).rows
    Phi, Phi_q, Phi_t, gamma = (array[rows] for array in constraint_arrays(scene.system, q, qd, t))
    zero = np.zeros_like(q)

    def along(direction, rate):
        levels = constraint_rows(scene.packed, np.array([t]), q[None], direction[None], zero[None], time_rate=rate)
        return [level[0, rows] for level in levels]

    value, _, second = along(qd, 1.0)
    for i in range(constraint.all_rows):
        _compare(name, f"compiled Phi[{i}]", Phi[i], value[i], np.append(q, 1.0))
        _compare(name, f"compiled Phi_t[{i}]", Phi_t[i], along(zero, 1.0)[1][i], Phi_t)
        _compare(name, f"compiled gamma[{i}]", gamma[i], second[i], np.abs(Phi_q) @ qd**2)
    names = [f"{c} of {body.name}" for body in scene.bodies for c in ("r1", "r2", "r3", "e0", "e1", "e2", "e3")]
    for j, coordinate in enumerate(names):
        direction = zero.copy()
        direction[j] = 1.0
        expected = along(direction, 0.0)[1]
        for i in range(constraint.all_rows):
            _compare(name, f"compiled Phi_q[{i}, {j}] ({coordinate})", Phi_q[i, j], expected[i], Phi_q)


def _compare(name, entry, got, expected, scale, remark=""):
    size = max(1.0, np.abs(expected), np.abs(scale).max(initial=0.0))
    if not abs(got - expected) <= ROUNDED * size:
        raise CheckFailed(f"{name}: {entry} is {got:.15g} and should be {np.real(expected):.15g}.{remark}")


# The check of `series` and `normal_series` in `check_force`: friction in proportion to a normal load.
#
# The reaction is a random series, too. Order zero of such friction is in the equations of motion as a whole, so the
# compiled loops are compared from order one on.


def check_friction_series(scene, force, name, rng):
    """Check the kernels of a friction's series, if it has those that a run would use."""
    packed = scene.packed
    (load,), kind = packed.loads, type(force)
    if no_series(force, load.parameters):
        return
    (rng,) = rng.spawn(1)  # the next scenes are what they were
    q, t = series_checks.random_motion(scene, rng), series_checks.random_time(rng)
    x, xd = series_checks.along(scene, force, load.coordinates, q)
    unit, f, par = series_checks.zeros(len(x)), series_checks.zeros(len(x)), [*load.parameters, 1.0]
    series_checks.run_truncated(kind, "law", name, x, xd, par, t, unit)
    labels = [
        f"out[{j}] (conjugate to {c}), of a unit normal load" for j, c in enumerate(series_checks.labels_of(kind))
    ]
    for k, out, _ in series_checks.coefficients_of(kind, name, (x, xd), par, (len(x),)):
        series_checks.compare(name, k, labels, out, unit)
    reaction, par[-1] = _checked_load(kind, name, x, par, rng)
    series_checks.run_truncated(kind, "law", name, x, xd, par, t, f)

    context, (where, *_keep) = series_checks.series_context(packed, *build(packed))
    expansion = context.expansion
    context.tangent.poses[:] = series_checks.write_bodies(scene, q, expansion).ravel()
    series_checks.begin_motions(where, t.c[0])
    first, orders = int(expansion.frictions[0].reaction), int(expansion.order.room)
    rows = expansion.loads[first : first + 6 * orders].reshape(6, orders)
    rows[:, : ORDER + 2] = [entry.c for entry in reaction]
    expected = series_checks.carried_back(scene, load, q, f)
    parts = [f"{what} {axis}" for what in ("force", "body torque") for axis in "xyz"]
    labels = [f"compiled {part} of {body.name}" for body in scene.bodies for part in parts]
    for k in range(ORDER):
        series_checks.force_coefficients(where, k)
        if k > 0:
            series_checks.compare(name, k, labels, context.tangent.Z.reshape(-1, 2, 4)[:-1, :, :3].ravel(), expected)


def _checked_load(kind, name, x, par, rng):
    """Check `normal_series` with random reactions, and return one and its normal load, as Truncated series.

    Where a part of the load is next to zero, terms of it cancel; a wrong series is wrong for every reaction.
    """
    for left in reversed(range(DRAWN)):
        drawn = rng.normal(size=(6, ORDER + 2)) * SHRINK ** np.arange(ORDER + 2)
        reaction = series_checks.objects([Truncated(c) for c in drawn])
        try:
            return reaction, _check_load(kind, name, x, reaction, par)
        except CheckFailed:
            if left == 0:
                raise
    raise AssertionError("one is drawn")


def _load(kind, name, x, reaction, par):
    try:
        return twin(kind.normal_load)(x, reaction, par)
    except TypeError as error:
        raise CheckFailed(f"{name}: normal_load can't be run on truncated Taylor series ({error}).") from error


def _check_load(kind, name, x, reaction, par):
    """Check `normal_series`; the normal load as a Truncated series."""
    load, scratch = _load(kind, name, x, reaction, par), np.full((kind.slots, ORDER + 2), np.nan)
    for k in range(ORDER + 1):
        place, f = [c.c[k] for c in x], np.array([c.c[k] for c in reaction])
        for known in (0.5, 1.0):  # what is known of an order, then the whole
            got = twin(kind.normal_series)(place, known * f, par, k, scratch)
        series_checks.compare(name, k, ["the normal load, by normal_series,"], [got], series_checks.objects([load]))
    return load


@entry
def evaluate_force_jacobian(s, q, qd, t, Q, Q_q, Q_qd, renew, kept):  # nine: with what is kept
    """Q (n,) += the forces, Q_q, Q_qd (n, n) += their Jacobians; s is from `with_force_jacobians`."""
    set_time(s, t)
    applied_forces(s, q, qd, t, Q)  # laws of the whole scene have derivatives where they were evaluated last
    force_jacobian(s, q, qd, t, Q_q, Q_qd, renew, kept)


def jacobians(packed, q, qd, t):
    """dQ/dq and dQ/dqd (n, n) of all forces of a packed scene, gravity has none."""
    system, size = with_force_jacobians(packed)
    system = system._replace(reals=system.reals.copy())
    Q_q, Q_qd = np.zeros((2, q.size, q.size))
    Q, kept = np.zeros(q.size), np.zeros(size)
    system.reals[system.normals] = 1.0
    if len(system.forces):
        evaluate_force_jacobian(system, q, qd, float(t), Q, Q_q, Q_qd, 1, kept)
    return Q_q, Q_qd


def check_force(kind: type[Force] | Callable[[AnyBody, AnyBody], Force], *, seed: int = 0, states: int = 3) -> None:
    """Check a force's kernels; return None, or raise naming the wrong entry.

    Parameters
    ----------
    kind : Force subclass, or callable (a, b) -> Force
        A class is checked with its `example(rng, a, b)`.
    seed, states : int
        As for `check_primitive`.

    Raises
    ------
    CheckFailed
        If the compiled force differs from the Python one, its Jacobians from differences of sixth order, dissipation is
        negative, or a force without loads gives or takes power that is in neither its potential nor its dissipation.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.testing.check_force(ts.forces.Spring, states=1)
    """
    rng = np.random.default_rng(seed)
    make = series_checks.maker(kind, (Force,), InvalidForce, lambda a, b: kind.example(rng, a, b))
    for scene, force, arrangement in series_checks.instances(make, rng, states):
        for body in scene.bodies:
            body.velocity, body.angular_velocity = rng.normal(size=3), 3.0 * rng.normal(size=3)
        name = f"{force._kind()} ({arrangement})"
        _check(scene, force, name, rng)
        check = check_friction_series if scene.packed.loads[0].normal >= 0 else series_checks.check_force_series
        check(scene, force, name, rng)


def _check(scene, force, name, rng):
    packed, (q, qd) = scene.packed, scene.start
    (load,) = packed.loads
    t = np.array([rng.uniform(0.2, 0.8)])
    memory = np.append(np.zeros(packed.system.memory.size), np.ones(packed.system.normals.size))[None]

    def Q(q, qd):
        return force_loads(packed.system, t, q[None], qd[None], memory)[0]

    value = Q(q, qd)
    if not np.isfinite(value).all():
        raise CheckFailed(f"{name}: the force is not finite at a random state: {value}.")
    coordinates = [f"{c} of {body.name}" for body in scene.bodies for c in ("r1", "r2", "r3", "e0", "e1", "e2", "e3")]
    if force.analytic:
        _check_twin(packed, load, name, t, q, qd, value, coordinates)
    _check_jacobians(packed, name, Q, q, qd, t[0], coordinates)
    _, lost, applied = (np.broadcast_to(x, (1,))[0] for x in load_powers(packed, load, t, q[None], qd[None], memory))
    size = np.abs(value) @ np.abs(qd)
    if lost < -ROUNDED * size:
        raise CheckFailed(f"{name}: dissipation is {lost:.6g} W; it can't be negative.")
    undriven = force.conservative and all(Signal.is_zero(getattr(force, attribute)) for attribute in force.loads)
    if undriven and not abs(applied) <= ROUNDED * (1.0 + size):
        raise CheckFailed(
            f"{name}: its power {value @ qd:.15g} W is not that of its potential and dissipation, {applied:.6g} W are "
            "left over. Correct them, or name the attributes that drive it in `loads`."
        )


def _check_twin(packed, load, name, t, q, qd, value, coordinates):
    """Compare the compiled force with the Python law, transformed by xd_qd."""
    x, xd = marker_states(packed, load, q[None], qd[None])
    par = [part for p in load.parameters for part in (p.value(t[0]) if isinstance(p, Signal) else [p])]
    par += [0.0] * load.force.memory + [1.0] * (load.normal >= 0)
    f = [0.0] * len(x)
    numbers = [[float(np.squeeze(entry)) for entry in part] for part in ([jet.x for jet in x], xd)]
    twin(type(load.force).law)(*numbers, par, t[0], f)
    for j, label in enumerate(coordinates):
        direction = np.zeros_like(qd)
        direction[j] = 1.0
        _, W = marker_states(packed, load, q[None], direction[None])
        expected = sum(float(np.squeeze(a)) * b for a, b in zip(W, f, strict=True))
        _compare_loads(name, f"compiled Q[{j}] ({label})", value[j], expected, value, ROUNDED)


def _check_jacobians(packed, name, Q, q, qd, t, coordinates):
    got = jacobians(packed, q, qd, t)
    weights = {1: 45.0 / 60.0, 2: -9.0 / 60.0, 3: 1.0 / 60.0}
    for which, matrix in zip(("q", "qd"), got, strict=True):
        for j, label in enumerate(coordinates):
            h = np.zeros_like(q)
            h[j] = SPACING
            shift = (lambda d: (q + d, qd)) if which == "q" else (lambda d: (q, qd + d))
            column = sum(w * (Q(*shift(k * h)) - Q(*shift(-k * h))) for k, w in weights.items()) / SPACING
            for i in range(q.size):
                _compare_loads(name, f"dQ[{i}] / d{which}[{j}] ({label})", matrix[i, j], column[i], got, QUOTIENT)


def _compare_loads(name, entry, got, expected, scale, tolerance):
    size = max(1.0, *(np.abs(part).max(initial=0.0) for part in scale))
    if not abs(got - expected) <= tolerance * size:
        raise CheckFailed(f"{name}: {entry} is {got:.15g} and should be {expected:.15g}.")
