"""The reduced ODE vdd = f(t, v, vd) of a scene and its linearisation, from Python: the kernels that a run calls."""

import numpy as np

import tsdyn as ts
from tsdyn.formulations.registry import formulation
from tsdyn.jit.kernels import caller, entry, resident
from tsdyn.methods.diagonally_implicit import call_linearise
from tsdyn.methods.explicit import call_accelerate, call_place
from tsdyn.model.equations import constraint_curvature, set_time, with_curvatures, with_force_jacobians
from tsdyn.observables.evaluate import mass_matrix
from tsdyn.workspaces import Context, allocate, allocate_linear, basis_free_parts

WEIGHTS = {1: 45 / 60, 2: -9 / 60, 3: 1 / 60}  # central differences of sixth order

NAMES = "place", "accelerate", "complete", "check", "start_chart", "linearise", "reduce", "factorise", "solve", "soften"

_call_vector, _call_number, _call_chart, _call_soften = caller("pp"), caller("pd"), caller("pdpppp"), caller("ppdp")


@entry
def _start(context, at, t, x, y, yd, xd):
    return _call_chart(at[4], context, t, x, y, yd, xd)


@entry
def _rates(context, at, t, x, y, yd, xd):
    status = call_place(at[0], context, t, x)
    if status == 0:
        status = call_accelerate(at[1], context, t, y, yd, xd)
    if status == 0:
        status = _call_vector(at[2], context, yd)
    return status


@entry
def _linearise(context, at, t, renew, vdd):
    status = 0
    if renew:
        status = call_linearise(at[5], context, t, vdd)
    return _call_number(at[6], context, t) if status == 0 else status


@entry
def solve(context, at, g, rho):
    """P^-1 A rho; at: addresses of factorise and solve."""
    status = _call_number(at[0], context, g)
    return _call_vector(at[1], context, rho) if status == 0 else status


@entry
def soften(context, at, ex, g, ey):
    """(I - g J)^-1 (ex, ey); at: addresses from that of factorise to that of soften."""
    status = _call_number(at[0], context, g)
    return _call_soften(at[-1], context, ex, g, ey) if status == 0 else status


@entry
def evaluate_curvature(s, q, qd, qdd, t, lam, K, G1, G2):
    """K += (Phi_q^T lam)_q, G1 and G2 of tsdyn.elements.loops.constraint_hessians; s is from `with_curvatures`."""
    set_time(s, t)
    constraint_curvature(s, q, qd, qdd, t, lam, K, G1, G2)


def with_derivatives(scene):
    """The packed scene, a system of its own with what implicit methods derive, and how much they keep of the forces."""
    packed = scene.packed
    system, kept = with_force_jacobians(packed._replace(system=with_curvatures(packed)))
    return packed, system._replace(reals=system.reals.copy()), kept


class Tangent:
    """The reduced ODE of a scene in the chart of its start."""

    def __init__(self, scene, t=0.0):
        packed, system, kept = with_derivatives(scene)
        q, qd = scene.start
        n, m = q.size, system.segments.shape[0]
        work = allocate(n, m, len(scene.bodies), 1e-14, packed.size)
        work.q[:], work.qd[:] = q, qd
        form = formulation("null-space")
        parts = basis_free_parts(form.graph(packed), n, True)
        self.context = Context(system, work, allocate_linear(system, n, m, True, kept), *parts)
        self.address, *self._keep = resident(self.context)
        found = form.addresses() | form.implicit()
        self.at = np.array([found[name] for name in NAMES], np.int64)
        self.k, self.t = n - m, t
        v, self.vd, vdd = np.zeros((3, self.k))
        assert _start(self.address, self.at, t, v, self.vd, vdd, vdd) == 0

    def f(self, v, vd, t):
        """Accelerations vdd; the place is taken."""
        vdd = np.zeros(self.k)
        assert _rates(self.address, self.at, t, v, vd, vdd, vdd) == 0
        self.vdd = vdd
        return vdd

    def jacobians(self, t, renew=True):
        """(f_v, f_vd) at the place last taken; without `renew`, from the stiffness and damping kept."""
        assert _linearise(self.address, self.at, t, int(renew), self.vdd) == 0
        work, linear = self.context.work, self.context.linear
        A = work.D.T @ mass_matrix(self.context.system, work.q) @ work.D
        return np.linalg.solve(A, -linear.K_hat), np.linalg.solve(A, linear.C_hat)

    def solved(self, g, rho):
        """P^-1 A rho, of the linearisation last made."""
        rho = rho.copy()
        assert solve(self.address, self.at[7:], g, rho) == 0
        return rho

    def softened(self, ex, g, ey):
        """(I - g J)^-1 (ex, ey)."""
        ex, ey = ex.copy(), ey.copy()
        assert soften(self.address, self.at[7:], ex, g, ey) == 0
        return np.concatenate((ex, ey))


class Mixed:
    """The mixed system (v, w)' of a scene with rows on velocities, none redundant, in the chart of its start."""

    def __init__(self, scene):
        packed, system, kept = with_derivatives(scene)
        q, qd = scene.start
        n, m = q.size, system.segments.shape[0]
        form = formulation("null-space").serving(ts.integrators.SDIRK54(), rates=True)
        graph = form.graph(packed)
        work = allocate(n, m, len(scene.bodies), 1e-14, packed.size, redundant=form.redundancy(packed, graph))
        work.q[:], work.qd[:] = q, qd
        parts = allocate_linear(system, n, m, True, kept), *basis_free_parts(graph, n, True)
        self.context = form.context(packed, Context(system, work, *parts), 0)
        self.address, *self._keep = resident(self.context)
        found = form.addresses() | form.implicit()
        self.at = np.array([found[name] for name in NAMES], np.int64)
        self.nx, self.ny = form.sizes(packed, graph)
        v, w, wd, vd = np.zeros(self.nx), np.zeros(self.ny), np.zeros(self.ny), np.zeros(self.nx)
        assert _start(self.address, self.at, 0.0, v, w, wd, vd) == 0
        self.start = np.concatenate([v, w])

    def f(self, z, t):
        """(vd, wd); the place is taken."""
        wd, vd = np.zeros(self.ny), np.zeros(self.nx)
        assert _rates(self.address, self.at, t, z[: self.nx].copy(), z[self.nx :].copy(), wd, vd) == 0
        self.wd = wd
        return np.concatenate([vd, wd])

    def jacobian(self, t, g=1e-3):
        """J at the place last taken, of the inverse of I - g J."""
        assert _linearise(self.address, self.at, t, 1, self.wd) == 0
        columns = np.eye(self.nx + self.ny)
        for column in columns:
            assert solve(self.address, self.at[7:], g, column) == 0
        return (np.eye(len(columns)) - np.linalg.inv(columns.T)) / g


def difference(f, x, h):
    """df/dx by central differences of sixth order, columns last."""
    columns = []
    for j in range(x.size):
        step = np.zeros(x.size)
        step[j] = h
        columns.append(sum(w * (f(x + k * step) - f(x - k * step)) for k, w in WEIGHTS.items()) / h)
    return np.stack(columns, axis=-1)
