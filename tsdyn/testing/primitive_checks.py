"""Checks of plug-ins, for their authors and for the project's tests."""

from __future__ import annotations

import warnings
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ..elements.joint import Joint
from ..elements.primitive import Primitive
from ..errors import CheckFailed, InvalidCall, TsdynError
from ..jit.kernels import NumbaError, twin
from ..maths.power_series import Jet
from ..maths.tolerances import COMPLEX_STEP
from ..model.packed import member_of
from ..motions.prescribed import Motion
from ..observables.diagnostics import constraint_rows
from ..observables.evaluate import constraint_arrays
from .series_checks import check_constraint_series, instances, maker
from .tolerances import NOT_ANALYTIC, REAL_STEP, ROUNDED

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..hints import AnyBody

NOT_HOLONOMIC = (
    " A row on velocities that is the rate of no phi is not holonomic; constraints are functions of positions and time."
)
_AXES = "xyz"


def check_primitive(
    kind: type[Primitive | Joint] | Callable[[AnyBody, AnyBody], Primitive | Joint], *, seed: int = 0, states: int = 3
) -> None:
    """Check a primitive's kernels against complex steps of its phi; return None, or raise naming the wrong entry.

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
        whose jacobian is of no phi is not holonomic, and refused too.

    Notes
    -----
    jacobian is compared with Phi_x by complex steps in x, phi_t with Phi_t by complex steps in t (motions with
    difference quotients of the complex-step kind too), gamma with the complex step of Phi_x xd + Phi_t along (xd, 1):
    (Phi_x xd)_x xd + 2 Phi_xt xd + Phi_tt (Haug 2018, Eq. 3). Then the compiled, assembled arrays are compared with
    phi carried along the motion as a truncated Taylor series, which uses neither jacobian nor gamma.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.testing.check_primitive(ts.constraints.Distance, states=1)
    """
    rng = np.random.default_rng(seed)
    make = maker(kind, (Primitive, Joint), TsdynError, lambda a, b: _example(kind, rng, a, b))
    for scene, constraint, arrangement in instances(make, rng, states):
        name = f"{type(constraint).__name__} ({arrangement})"
        for part in constraint.parts:
            own = name if part is constraint else f"{type(part).__name__} in {name}"
            _check_kernels(part, own, rng, part.parameters())
            if type(part).example.__func__ is Primitive.example.__func__:
                _check_perturbed(part, own, rng)
        _check_assembled(scene, constraint, name, rng)
        check_constraint_series(scene, constraint, name, rng)


def _example(kind, rng, a, b):
    try:
        return kind.example(rng, a, b)
    except InvalidCall as error:
        raise CheckFailed(
            f"{kind.__name__}: no example could be made ({error}); give the argument a default, or write a classmethod "
            "example(cls, rng, a, b) that returns a random valid instance."
        ) from error


def _check_perturbed(constraint, name, rng):
    """The kernels with other numbers as par: where they are defaults such as 1, a power of them can't be told."""
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
    kind = type(constraint)
    written = [kernel for kernel in ("phi", "jacobian", "gamma", "phi_t") if kernel in kind.kernels]
    f = SimpleNamespace(**{kernel: _python(constraint, kernel, name, par) for kernel in written})
    size = sum(m.size for m in kind.markers)
    x, xd, t = rng.normal(size=size), 10.0 * rng.normal(size=size), rng.uniform(0.1, 2.0)
    for kernel in written:
        _demand_no_comparison(getattr(f, kernel), kernel, name, kind.rows, x, xd, t)
    # entries are named by the argument that places their marker
    labels = [
        f"{m.argument}, component {_AXES[i] if m.size == 3 else f'e{i}'}" for m in kind.markers for i in range(m.size)
    ]

    Phi_x = np.zeros((kind.rows, size))
    f.jacobian(x, t, Phi_x)
    fixed = _vector(f.phi, kind.rows, x, t) == _vector(f.phi, kind.rows, x + xd, t)
    for j in range(size):
        step = np.zeros(size, complex)
        step[j] = 1j * COMPLEX_STEP
        expected = _vector(f.phi, kind.rows, x + step, t).imag / COMPLEX_STEP
        h = REAL_STEP * step.imag / COMPLEX_STEP
        quotient = (_vector(f.phi, kind.rows, x + h, t) - _vector(f.phi, kind.rows, x - h, t)).real / (2.0 * REAL_STEP)
        if not np.allclose(quotient, expected, rtol=NOT_ANALYTIC, atol=NOT_ANALYTIC * (1.0 + np.abs(Phi_x).max())):
            raise CheckFailed(
                f"{name}: phi is not analytic, so its complex steps say nothing: it compares, or takes abs or norm of, "
                "x. Write np.sqrt(x[0] ** 2 + ...) for a norm."
            )
        for i in range(kind.rows):
            entry = f"jacobian[{i}, {j}] (d phi[{i}] / d {labels[j]})"
            _compare(name, entry, Phi_x[i, j], expected[i], Phi_x, NOT_HOLONOMIC if fixed[i] else "")

    expected = _vector(f.phi, kind.rows, x, t + 1j * COMPLEX_STEP).imag / COMPLEX_STEP
    if hasattr(f, "phi_t"):
        Phi_t = _vector(f.phi_t, kind.rows, x, t)
        for i in range(kind.rows):
            _compare(name, f"phi_t[{i}]", Phi_t[i], expected[i], expected)
    elif expected.any():
        raise CheckFailed(
            f"{name}: phi depends on the time, d phi / dt = {expected}, but there is no phi_t; write one."
        )

    def rate(s):
        jacobian = np.zeros((kind.rows, size), complex)
        f.jacobian(x + s * xd, t + s, jacobian)
        total = jacobian @ xd
        return total + _vector(f.phi_t, kind.rows, x + s * xd, t + s) if hasattr(f, "phi_t") else total

    expected = rate(1j * COMPLEX_STEP).imag / COMPLEX_STEP
    gamma = np.zeros(kind.rows)
    f.gamma(x, t, gamma, xd)
    scale = np.abs(np.abs(Phi_x) @ xd**2)
    for i in range(kind.rows):
        _compare(name, f"gamma[{i}]", gamma[i], expected[i], scale)


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
    out = np.full((rows, len(x)) if kernel == "jacobian" else rows, 0.0, object)
    try:
        function(x, t, out, *([xd] if kernel == "gamma" else []))
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


def _vector(function, rows, x, t):
    out = np.zeros(rows, complex)
    function(x, t, out)
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
    for i in range(constraint.rows):
        _compare(name, f"compiled Phi[{i}]", Phi[i], value[i], np.append(q, 1.0))
        _compare(name, f"compiled Phi_t[{i}]", Phi_t[i], along(zero, 1.0)[1][i], Phi_t)
        _compare(name, f"compiled gamma[{i}]", gamma[i], second[i], np.abs(Phi_q) @ qd**2)
    names = [f"{c} of {body.name}" for body in scene.bodies for c in ("r1", "r2", "r3", "e0", "e1", "e2", "e3")]
    for j, coordinate in enumerate(names):
        direction = zero.copy()
        direction[j] = 1.0
        expected = along(direction, 0.0)[1]
        for i in range(constraint.rows):
            _compare(name, f"compiled Phi_q[{i}, {j}] ({coordinate})", Phi_q[i, j], expected[i], Phi_q)


def _compare(name, entry, got, expected, scale, remark=""):
    size = max(1.0, np.abs(expected), np.abs(scale).max(initial=0.0))
    if not abs(got - expected) <= ROUNDED * size:
        raise CheckFailed(f"{name}: {entry} is {got:.15g} and should be {np.real(expected):.15g}.{remark}")
