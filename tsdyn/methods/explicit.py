"""The step kernels of explicit tableau methods and of plug-ins, and how step kernels and error estimates are called."""

from ..jit.kernels import ANY, callback, caller, kernel, vector
from ..jit.simd import add, four, put, splat, times
from ..maths.dense_linalg import copy
from ..workspaces import load_run

# The step kernels of explicit tableau methods, and how step kernels and error estimates are called.
#
# A formulation supplies two kernels, called by address:
#
#     place(context, t, x)                set positions: evaluate all that depends on t and x alone
#     accelerate(context, t, y, yd, xd)   set velocities; return yd and, for a first-order system, xd
#
# A step kernel, step(context, run, t, h), makes a step h from t. It reads x, y and their derivatives xd, yd at the
# start of the step from the `RunState`, and writes the increments dx, dy there, which the driver adds by compensated
# summation. The memory of a Runge-Kutta method holds n = nx + ny floats of scratch, then (x', y') of each stage.

PLACE, ACCELERATE, NORMAL, STEP = "pdp", "pdppp", "pdpp", "ppdd"
ERROR, NORM = "diipppppp", "ppppdd"
call_norm = caller(NORM, "d")
call_error = caller(ERROR)
call_place = caller(PLACE)
call_normal = caller(NORMAL)
call_accelerate = caller(ACCELERATE)
call_step = caller(STEP)


def error_kernel(function):
    """Decorate the kernel of an error estimate: f(h, nx, ny, y, yd, tableau, memory, ex, ey).

    It writes the errors ex, ey of the step that `memory` holds, y and yd being x' and y' at its end, and returns 0.
    Arrays come as addresses: `vector(ex, nx)` is the array.
    """
    return callback(ERROR)(function)


@kernel
def _add_stages(weights, count, h, k, stride, out):
    """out += h sum_j weights_j k_j over the first stages, k_j at k[j stride].

    Sixteen sums at a time stay in registers; coefficients that are zero are skipped.
    """
    whole = out.size // 16 * 16
    for c in range(0, whole, 16):
        p, q, r, s = four(out, c), four(out, c + 4), four(out, c + 8), four(out, c + 12)
        for j in range(count):
            f, at = h * weights[j], j * stride + c
            if f != 0.0:
                g = splat(f)
                p, q = add(p, times(g, four(k, at))), add(q, times(g, four(k, at + 4)))
                r, s = add(r, times(g, four(k, at + 8))), add(s, times(g, four(k, at + 12)))
        put(out, c, p)
        put(out, c + 4, q)
        put(out, c + 8, r)
        put(out, c + 12, s)
    for c in range(whole, out.size):
        total = out[c]
        for j in range(count):
            f = h * weights[j]
            if f != 0.0:
                total += f * k[j * stride + c]
        out[c] = total


@callback(STEP)
def nystrom_step(context, run, t, h):
    """One step of an explicit Nystrom method, xd = y; memory (stages + 2) n."""
    r = load_run(run)
    n, x, y, tableau, memory = r.x.size, r.x, r.y, r.tableau, r.memory
    stages = int(tableau[0])
    xs, ys, k = memory[:n], memory[n : 2 * n], memory[2 * n :]
    width = 2 + 2 * stages
    copy(r.yd, k)
    for i in range(1, stages):
        row = tableau[1 + i * width :]
        ti = t + h * row[1]
        # y_i = y + h sum_j a_ij k_j
        copy(y, ys)
        _add_stages(row[2 + stages :], i, h, k, n, ys)
        # x_i = x + h c_i y + h^2 sum_j abar_ij k_j, placed unless the stage before was there
        if row[0] == 0.0:
            for c in range(n):
                xs[c] = h * row[1] * y[c]
            _add_stages(row[2:], i, h * h, k, n, xs)
            for c in range(n):
                xs[c] += x[c]
            status = call_place(r.kernels.stage_place, context, ti, xs)
            if status != 0:
                return status
        status = call_accelerate(r.kernels.stage_accelerate, context, ti, ys, k[i * n :], r.xd)
        if status != 0:
            return status
    # dx = h y + h^2 sum_j bbar_j k_j,  dy = h sum_j b_j k_j
    weights = tableau[1 + stages * width :]
    for c in range(n):
        r.dx[c] = h * y[c]
        r.dy[c] = 0.0
    _add_stages(weights, stages, h * h, k, n, r.dx)
    _add_stages(weights[stages:], stages, h, k, n, r.dy)
    return 0


@kernel
def combine(weights, count, h, n, memory, out):
    """out = h sum_j weights_j k_j over the first stages in the memory of a Runge-Kutta method."""
    out = out[:n]
    for c in range(n):
        out[c] = 0.0
    _add_stages(weights, count, h, memory[n:], n, out)


@kernel
def stage(context, r, second, t, h, i, row):
    """Stage i: the derivatives at t + h c_i, (x, y) + h sum_j a_ij k_j. Status.

    row is c_i, then a_i; (x, y) is the start of the step, as the driver keeps it. second: where x' = y.
    """
    nx, ny, memory = r.x_old.size, r.y_old.size, r.memory
    n, ti = nx + ny, t + h * row[0]
    xs, ys, k = memory[:nx], memory[nx:n], memory[(1 + i) * n :][:n]
    # (x, y) + h sum_j a_ij k_j
    combine(row[1:], i, h, n, memory, memory)
    for c in range(nx):
        xs[c] += r.x_old[c]
    for c in range(ny):
        ys[c] += r.y_old[c]
    status = call_place(r.kernels.stage_place, context, ti, xs)
    if status == 0:
        if second:
            copy(ys, k[:nx])
        # accelerate leaves x' of a second-order system alone
        status = call_accelerate(r.kernels.stage_accelerate, context, ti, ys, k[nx:], k[:nx])
    return status


@kernel
def _step(context, r, second, t, h):
    """One step of an explicit Runge-Kutta method on (x, y); second: where x' = y. Status."""
    nx, ny, tableau, memory = r.x.size, r.y.size, r.tableau, r.memory
    n, stages = nx + ny, int(tableau[0])
    width = 2 + stages
    # The first stage is the end of the step before
    copy(r.y if second else r.xd, memory[n:])
    copy(r.yd, memory[n + nx :])
    # k_i = f(t + c_i h, (x, y) + h sum_j a_ij k_j)
    for i in range(1, stages):
        status = stage(context, r, second, t, h, i, tableau[1 + i * width + 1 :])
        if status != 0:
            return status
    # h sum_i b_i k_i
    combine(tableau[1 + stages * width :], stages, h, n, memory, memory)
    copy(memory[:nx], r.dx)
    copy(memory[nx:n], r.dy)
    return 0


@callback(STEP)
def second_order_step(context, run, t, h):
    """One step of an explicit Runge-Kutta method on (x, y) with xd = y; memory (stages + 1) 2 n."""
    return _step(context, load_run(run), True, t, h)


@callback(STEP)
def runge_kutta_step(context, run, t, h):
    """One step of an explicit Runge-Kutta method on the first-order system (x, y); memory (stages + 1)(nx + ny)."""
    return _step(context, load_run(run), False, t, h)


@kernel
def _weigh(weights, stages, h, n, memory, end, out):
    """out = h (sum_j w_j k_j + w_end k_end), one k every n floats of the memory."""
    # The derivative at the step's end, then those of the stages
    for c in range(out.size):
        out[c] = h * weights[stages] * end[c]
    _add_stages(weights, stages, h, memory[n:], n, out)


@kernel
def _error(which, h, y, yd, tableau, memory, ex, ey):
    """Errors by a row of error weights; of the derivatives at the step's end, x' is y."""
    nx, n, stages = ex.size, ex.size + ey.size, int(tableau[0])
    # Rows of error weights follow the row b of the tableau
    weights = tableau[1 + stages * (2 + stages) + stages + which * (stages + 1) :]
    _weigh(weights, stages, h, n, memory, y, ex)
    _weigh(weights, stages, h, n, memory[nx:], yd, ey)


@callback(ERROR)
def embedded_error(h, nx, ny, y, yd, tableau, memory, ex, ey):  # nine: as plug-ins have it
    """Errors ex, ey of the step that `memory` holds, y and yd being the derivatives at its end."""
    y, yd, ex, ey = vector(y, nx), vector(yd, ny), vector(ex, nx), vector(ey, ny)
    _error(0, h, y, yd, vector(tableau, ANY), vector(memory, ANY), ex, ey)
    return 0


@callback(ERROR)
def second_embedded_error(h, nx, ny, y, yd, tableau, memory, ex, ey):  # nine: as plug-ins have it
    """The same by the tableau's second row of error weights."""
    y, yd, ex, ey = vector(y, nx), vector(yd, ny), vector(ex, nx), vector(ey, ny)
    _error(1, h, y, yd, vector(tableau, ANY), vector(memory, ANY), ex, ey)
    return 0


# Step kernels of plug-ins, written to the documented interface: docs/plug-ins.md.
#
# A plug-in's step kernel has its arrays as arguments, not the `RunState`. `plug_in_step` is what the driver
# calls in its place.

PLUG_IN_STEP = "piiddiipppppppp"
_call = caller(PLUG_IN_STEP)


def step_kernel(function):
    """Decorate a step kernel: f(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy).

    It writes the increments dx, dy and returns 0, or the status that `call_place` or `call_accelerate` gave. Arrays
    come as addresses, integers: `vector(x, nx)` is the array of nx floats there, without a copy. x, xd and dx have nx
    floats, y, yd and dy have ny; lengths are not checked. In forms with x' = y nothing is in xd.
    """
    return callback(PLUG_IN_STEP)(function)


@callback(STEP)
def plug_in_step(context, run, t, h):
    """One step by the kernel of a plug-in. Status."""
    r = load_run(run)
    return _call(
        r.kernels.plug_in, context, r.kernels.stage_place, r.kernels.stage_accelerate, t, h, r.x.size, r.y.size,
        r.x, r.y, r.yd, r.xd, r.tableau, r.memory, r.dx, r.dy,
    )  # fmt: skip


def called_for(step):
    """The step kernel that the driver calls for a method's, and the one of a plug-in behind it, or None."""
    return (plug_in_step, step) if step.signature == PLUG_IN_STEP else (step, None)
