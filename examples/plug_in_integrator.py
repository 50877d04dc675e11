"""Two integrator plug-ins: a tableau with an error estimate, and a method with its own step kernel.

BogackiShampine, the pair 3(2) of many an `ode23`, is defined by its coefficients alone. Extrapolation applies Gragg's
modified midpoint rule with 2, 4 and 6 substeps and Richardson extrapolation, for order 6; its kernel steps any system
x' = ..., y' = f(t, x, y), compiled and cached like the built-in methods.

Run it: python examples/plug_in_integrator.py
"""

import numpy as np

import tsdyn as ts
from tsdyn.plugins import call_accelerate, call_place, error_kernel, step_kernel, vector


class BogackiShampine(ts.ExplicitRungeKutta):
    """Explicit Runge-Kutta pair 3(2); P. Bogacki, L. F. Shampine, Appl. Math. Lett. 2, 321-325 (1989)."""

    order = 3
    tableau = ts.RungeKuttaTableau(
        a=((), (1 / 2,), (0, 3 / 4)),
        b=(2 / 9, 1 / 3, 4 / 9),
        c=(0, 1 / 2, 3 / 4),
        order=3,
        error=(-5 / 72, 1 / 12, 1 / 9, -1 / 8),  # the last weighs the derivative at the step's end
        embedded_order=2,
    )


COLUMNS = 3  # parts 2, 4, 6
ANY = 1 << 40  # the length of an array that the kernel is trusted with


@ts.kernel
def derivatives(system, t, x, y, xd, yd):
    """x' and y' at (t, x, y). Status."""
    context, place, accelerate, second_order = system
    status = call_place(place, context, t, x)
    if status == 0:
        status = call_accelerate(accelerate, context, t, y, yd, xd)  # writes x' of a first-order system
    if second_order != 0:
        for c in range(xd.size):
            xd[c] = y[c]
    return status


@ts.kernel
def extrapolate(system, t, h, x, y, xd, yd, memory, dx, dy):  # two of each kind: of positions, of velocities
    """Increments by the table T[j, k] = T[j, k-1] + (T[j, k-1] - T[j-1, k-1]) / ((n_j / n_(j-k))^2 - 1). Status."""
    nx, ny = x.size, y.size
    n = nx + ny
    z, slope, last, now, table = memory[:n], memory[n:], memory[2 * n :], memory[3 * n :], memory[4 * n :]
    for j in range(COLUMNS):
        parts = 2 * (j + 1)
        part = h / parts
        for c in range(n):
            last[c] = 0.0  # increments of two points in time, from the step's start
            now[c] = part * (xd[c] if c < nx else yd[c - nx])
        for i in range(1, parts):
            for c in range(n):
                z[c] = now[c] + (x[c] if c < nx else y[c - nx])
            status = derivatives(system, t + i * part, z[:nx], z[nx:n], slope[:nx], slope[nx:n])
            if status != 0:
                return status
            for c in range(n):
                last[c], now[c] = now[c], last[c] + 2.0 * part * slope[c]
        for c in range(n):
            entry = now[c]
            for k in range(j + 1):  # along the row; what was there is the row before
                before = table[k * n + c]
                table[k * n + c] = entry
                if k < j:
                    ratio = parts / (2.0 * (j - k))
                    entry += (entry - before) / (ratio * ratio - 1.0)
    best = table[(COLUMNS - 1) * n :]
    for c in range(nx):
        dx[c] = best[c]
    for c in range(ny):
        dy[c] = best[nx + c]
    return 0


# step and error kernels have the arguments that drivers give: docs/plug-ins.md


@step_kernel
def second_order_step(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, numbers, memory, dx, dy):
    """A step of the tangent-space ODE, where x' = y."""
    x, y, yd, dx, dy = vector(x, nx), vector(y, nx), vector(yd, nx), vector(dx, nx), vector(dy, nx)
    return extrapolate((context, place, accelerate, 1), t, h, x, y, y, yd, vector(memory, ANY), dx, dy)


@step_kernel
def first_order_step(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, numbers, memory, dx, dy):
    """A step of the Maggi/Kane form."""
    x, y, yd, xd, dx, dy = vector(x, nx), vector(y, ny), vector(yd, ny), vector(xd, nx), vector(dx, nx), vector(dy, ny)
    return extrapolate((context, place, accelerate, 0), t, h, x, y, xd, yd, vector(memory, ANY), dx, dy)


@error_kernel
def last_difference(h, nx, ny, y, yd, numbers, memory, ex, ey):
    """The last two entries of the table's last row differ by the error of the lower one, of order 4."""
    n = nx + ny
    table, ex, ey = vector(memory, ANY)[4 * n :], vector(ex, nx), vector(ey, ny)
    for c in range(n):
        off = table[(COLUMNS - 1) * n + c] - table[(COLUMNS - 2) * n + c]
        if c < nx:
            ex[c] = off
        else:
            ey[c - nx] = off
    return 0


class Extrapolation(ts.Adaptive):
    """Gragg's modified midpoint rule, extrapolated to order 6."""

    order = 6
    embedded_order = 4
    errors = (last_difference,)

    def kernel(self, first_order):
        """The kernel, no numbers, and the memory: four vectors and the table."""
        step = first_order_step if first_order else second_order_step
        return step, np.zeros(1), lambda nx, ny: (4 + COLUMNS) * (nx + ny)


METHODS = (BogackiShampine, Extrapolation)


def build():
    """Return the scene: a rigid pendulum on a ball joint, swinging and spinning."""
    scene = ts.Scene()
    body = scene.add_body(
        mass=2.0,
        inertia=(0.05, 0.06, 0.02),
        position=(0.5, 0.0, 0.0),
        velocity=(0.0, 1.0, 0.0),
        angular_velocity=(0.0, 0.0, 2.0),
        name="bob",
    )
    scene.add(ts.constraints.Spherical(body, scene.ground, point_a=(-0.5, 0.0, 0.0), name="pivot"))
    return scene


def check(solution):
    """The run keeps its constraints to rounding, and its energy."""
    assert solution.success, solution.message
    assert solution.constraint_error.position.max() < 1e-14
    assert solution.constraint_error.velocity.max() < 1e-13
    assert solution.constraint_error.acceleration.max() < 1e-11
    assert np.ptp(solution.energy) < 1e-5 * np.abs(solution.kinetic_energy).max()


def main():
    """Check both methods, run one, and compare them with a built-in one."""
    for method in METHODS:
        found = ts.testing.check_integrator(method)
        orders = ", ".join(f"{finding.order:.2f}" for finding in found)
        print(f"{method.__name__}: declared order {method.order}, observed {orders}")
    solution = ts.simulate(build(), (0.0, 5.0), integrator=Extrapolation(rtol=1e-8, atol=1e-8))
    check(solution)
    print(solution)
    print(ts.benchmark(build(), [*METHODS, "rk45"], (1e-4, 1e-6, 1e-8), t_span=(0.0, 5.0)))


if __name__ == "__main__":
    main()
