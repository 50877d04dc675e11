"""The step kernels of tableau methods.

A formulation supplies two kernels, called by address:

    place(context, t, x)                set positions: evaluate all that depends on t and x alone
    accelerate(context, t, y, yd, xd)   set velocities; return yd and, for a first-order system, xd

A step kernel returns the increments dx, dy, which the driver adds by compensated summation. Signature of a step kernel:
context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy; yd and xd are the derivatives at the
start of the step. The memory of a Runge-Kutta method holds n = nx + ny floats of scratch, then (x', y') of each stage.
"""

from ..jit.kernels import ANY, callback, caller, kernel, vector
from ..maths.dense_linalg import copy

PLACE, ACCELERATE, STEP = "pdp", "pdppp", "piiddiipppppppp"
ERROR, NORM = "diipppppp", "ppppdd"
call_norm = caller(NORM, "d")
call_error = caller(ERROR)
call_place = caller(PLACE)
call_accelerate = caller(ACCELERATE)
call_step = caller(STEP)


def step_kernel(function):
    """Decorate a step kernel: f(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy).

    It writes the increments dx, dy and returns 0, or the status that `call_place` or `call_accelerate` gave. Arrays
    come as addresses: `vector(x, nx)` is the array.
    """
    return callback(STEP)(function)


def error_kernel(function):
    """Decorate the kernel of an error estimate: f(h, nx, ny, y, yd, tableau, memory, ex, ey).

    It writes the errors ex, ey of the step that `memory` holds, y and yd being x' and y' at its end, and returns 0.
    """
    return callback(ERROR)(function)


@kernel
def _add(out, f, k):
    """out += f k, where f is not zero."""
    if f != 0.0:
        for c in range(out.size):
            out[c] += f * k[c]


@callback(STEP)
def nystrom_step(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy):
    """One step of an explicit Nystrom method, xd = y; memory (stages + 2) n."""
    n = nx
    x, y, yd, dx, dy = vector(x, n), vector(y, n), vector(yd, n), vector(dx, n), vector(dy, n)
    tableau, memory = vector(tableau, ANY), vector(memory, ANY)
    stages = int(tableau[0])
    xs, ys = memory[:n], memory[n : 2 * n]
    width = 2 + 2 * stages
    copy(yd, memory[2 * n : 3 * n])
    for i in range(1, stages):
        row = tableau[1 + i * width :]
        ti = t + h * row[1]
        copy(y, ys)
        for j in range(i):
            _add(ys, h * row[2 + stages + j], memory[(2 + j) * n :])
        if row[0] == 0.0:  # not where the stage before was
            for c in range(n):
                xs[c] = h * row[1] * y[c]
            for j in range(i):
                _add(xs, h * h * row[2 + j], memory[(2 + j) * n :])
            for c in range(n):
                xs[c] += x[c]
            status = call_place(place, context, ti, xs)
            if status != 0:
                return status
        status = call_accelerate(accelerate, context, ti, ys, memory[(2 + i) * n :], xd)
        if status != 0:
            return status
    weights = tableau[1 + stages * width :]
    for c in range(n):
        dx[c] = h * y[c]
        dy[c] = 0.0
    for j in range(stages):
        _add(dx, h * h * weights[j], memory[(2 + j) * n :])
        _add(dy, h * weights[stages + j], memory[(2 + j) * n :])
    return 0


@kernel
def combine(weights, count, h, n, memory, out):
    """out = h sum_j weights_j k_j over the first stages in the memory of a Runge-Kutta method."""
    out = out[:n]
    for c in range(n):
        out[c] = 0.0
    for j in range(count):
        _add(out, h * weights[j], memory[(1 + j) * n :])


@kernel
def stage(context, place, accelerate, second, t, h, i, nx, ny, x, y, weights, memory):
    """Derivatives at t and (x, y) + h sum_j weights_j k_j, as stage i; second: where x' = y. Status."""
    n = nx + ny
    xs, ys, k = memory[:nx], memory[nx:n], memory[(1 + i) * n :][:n]
    combine(weights, i, h, n, memory, memory)
    for c in range(nx):
        xs[c] += x[c]
    for c in range(ny):
        ys[c] += y[c]
    status = call_place(place, context, t, xs)
    if status == 0:
        if second:
            copy(ys, k[:nx])
        status = call_accelerate(accelerate, context, t, ys, k[nx:], k[:nx])  # of a second order it leaves x' alone
    return status


@kernel
def _step(context, place, accelerate, second, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy):
    n = nx + ny
    stages = int(tableau[0])
    width = 2 + stages
    copy(xd, memory[n:])
    copy(yd, memory[n + nx :])
    for i in range(1, stages):
        row = tableau[1 + i * width :]
        status = stage(context, place, accelerate, second, t + h * row[1], h, i, nx, ny, x, y, row[2:], memory)
        if status != 0:
            return status
    combine(tableau[1 + stages * width :], stages, h, n, memory, memory)
    copy(memory[:nx], dx)
    copy(memory[nx:n], dy)
    return 0


@callback(STEP)
def second_order_step(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy):
    """One step of an explicit Runge-Kutta method on (x, y) with xd = y; memory (stages + 1) 2 n."""
    x, y, yd, dx, dy = vector(x, nx), vector(y, nx), vector(yd, nx), vector(dx, nx), vector(dy, nx)
    tableau, memory = vector(tableau, ANY), vector(memory, ANY)
    return _step(context, place, accelerate, True, t, h, nx, nx, x, y, yd, y, tableau, memory, dx, dy)


@callback(STEP)
def runge_kutta_step(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy):
    """One step of an explicit Runge-Kutta method on the first-order system (x, y); memory (stages + 1)(nx + ny)."""
    x, y, yd, xd = vector(x, nx), vector(y, ny), vector(yd, ny), vector(xd, nx)
    dx, dy, tableau, memory = vector(dx, nx), vector(dy, ny), vector(tableau, ANY), vector(memory, ANY)
    return _step(context, place, accelerate, False, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy)


@kernel
def _error(row, h, nx, ny, y, yd, tableau, memory, ex, ey):
    n = nx + ny
    y, yd, ex, ey = vector(y, nx), vector(yd, ny), vector(ex, nx), vector(ey, ny)
    tableau, memory = vector(tableau, ANY), vector(memory, ANY)
    stages = int(tableau[0])
    weights = tableau[1 + stages * (2 + stages) + stages + row * (stages + 1) :]
    for c in range(nx):
        ex[c] = h * weights[stages] * y[c]
    for c in range(ny):
        ey[c] = h * weights[stages] * yd[c]
    for j in range(stages):
        _add(ex, h * weights[j], memory[(1 + j) * n :])
        _add(ey, h * weights[j], memory[(1 + j) * n + nx :])
    return 0


@callback(ERROR)
def embedded_error(h, nx, ny, y, yd, tableau, memory, ex, ey):
    """Errors ex, ey of the step that `memory` holds, y and yd being the derivatives at its end."""
    return _error(0, h, nx, ny, y, yd, tableau, memory, ex, ey)


@callback(ERROR)
def second_embedded_error(h, nx, ny, y, yd, tableau, memory, ex, ey):
    """The same by the tableau's second row of error weights."""
    return _error(1, h, nx, ny, y, yd, tableau, memory, ex, ey)
