"""The matrices of implicit stages in the tangent form, from Python: the kernels that a run calls."""

import numpy as np

import tsdyn as ts
from tests.helpers.reduced_ode import soften, with_derivatives
from tsdyn.formulations.registry import formulation
from tsdyn.formulations.saddle_point import add_constraints, add_forces
from tsdyn.formulations.tolerances import TURN_LIMIT
from tsdyn.jit.kernels import caller, entry, resident
from tsdyn.methods.diagonally_implicit import call_linearise, call_reduce
from tsdyn.methods.explicit import call_accelerate, call_place
from tsdyn.model.equations import applied_forces, evaluate_constraints, set_time
from tsdyn.rows.saddle_matrix import BLOCK, saddle_of
from tsdyn.workspaces import Context, allocate, allocate_linear, basis_free_parts
from tsdyn.workspaces import load as load_context

_call_chart, call_check = caller("pdpppp"), caller("p")
NAMES = "place", "accelerate", "start_chart", "check", "linearise", "reduce", "factorise", "soften"
PLACE, ACCELERATE, CHART, CHECK, LINEARISE, REDUCE, FACTORISE, SOFTEN = range(8)


@entry
def _start(context, at, t, x, y, yd):
    return _call_chart(at[CHART], context, t, x, y, yd, yd)


@entry
def _check(context, at):
    return call_check(at[CHECK], context)


@entry
def _linearised(context, at, t, x, y, yd):
    status = call_place(at[PLACE], context, t, x)
    if status == 0:
        status = call_accelerate(at[ACCELERATE], context, t, y, yd, yd)
    if status == 0:
        status = call_linearise(at[LINEARISE], context, t, yd)
    return call_reduce(at[REDUCE], context, t) if status == 0 else status


@entry
def _blocks(context, t, lam):
    c = load_context(context)
    for i in range(c.saddle.K.size):
        c.saddle.K[i] = c.saddle.C[i] = 0.0
    add_forces(c.system, c.work, c.saddle, t, 1, c.linear.kept, c.tangent.Q)
    add_constraints(c.system, c.work, c.saddle, t, lam)
    return 0


@entry
def _forces(system, q, qd, t, Q):
    set_time(system, t)
    applied_forces(system, q, qd, t, Q)
    return 0


class Stages:
    """The tangent form of implicit methods in the chart of a scene's start."""

    def __init__(self, scene, t=0.0):
        packed, system, kept = with_derivatives(scene)
        q, qd = scene.start
        n, m = q.size, system.segments.shape[0]
        form = formulation("tangent").serving(ts.integrators.SDIRK54())
        graph = form.graph(packed)
        work = allocate(n, m, len(scene.bodies), 1e-14, packed.size, len(graph.row))
        work.q[:], work.qd[:] = q, qd
        parts = basis_free_parts(graph, n, False, saddle_of(packed, graph, system))
        self.context = Context(system, work, allocate_linear(system, n, m, False, kept), *parts)
        self.context.chart.state.turn_limit = TURN_LIMIT  # as `StepEngine.lay_out`
        self.address, *self._keep = resident(self.context)
        found = form.addresses() | form.implicit()
        self.at, self.k = np.array([found[name] for name in NAMES], np.int64), 8 * len(scene.bodies)
        x, self.y, yd = np.zeros((3, self.k))
        assert _start(self.address, self.at, t, x, self.y, yd) == 0

    def f(self, x, y, t):
        """Accelerations of chart coordinates; the linearisation is taken there."""
        yd = np.zeros(self.k)
        assert _linearised(self.address, self.at, t, x, y, yd) == 0
        return yd

    def check(self):
        """The reason to leave the chart, or zero."""
        return _check(self.address, self.at)

    def softened(self, ex, g, ey):
        """(I - g J)^-1 (ex, ey)."""
        ex, ey = ex.copy(), ey.copy()
        assert soften(self.address, self.at[FACTORISE:], ex, g, ey) == 0
        return np.concatenate((ex, ey))

    @property
    def projection(self):
        """P0, along Y0."""
        graph, rows = self.context.graph, self.context.chart.rows0
        H, Y = np.zeros((2, len(graph.row), self.k + 8))
        for e, sides in enumerate(graph.sides):
            for k, b in enumerate(sides):
                H[e, 8 * b : 8 * b + 8] += rows.H[16 * e + 8 * k :][:8]
                Y[e, 8 * b : 8 * b + 8] += rows.Y[16 * e + 8 * k :][:8]
        H, Y = H[:, :-8], Y[:, :-8]
        return np.eye(self.k) - Y.T @ np.linalg.solve(H @ Y.T, H)

    @property
    def moving(self):
        """Which entries of chart coordinates there are."""
        lengths = self.context.graph.bodies[:, 1]
        return np.concatenate([[True] * 3 + [False] + [length == 7] * 3 + [False] for length in lengths])

    def blocks(self, t, lam):
        """K and C of forces and constraints as matrices, at the last place and multipliers lam of the rows of Phi."""
        graph, saddle = self.context.graph, self.context.saddle
        assert _blocks(self.address, t, np.where(graph.row >= 0, lam[graph.row], 0.0)) == 0
        matrices = np.zeros((2, 6 * len(graph.bodies), 6 * len(graph.bodies)))
        for i, block in enumerate(saddle.graph.blocks):
            rows, columns = slice(6 * block.row, 6 * block.row + 6), slice(6 * block.column, 6 * block.column + 6)
            for matrix, values in zip(matrices, (saddle.K, saddle.C), strict=True):
                matrix[rows, columns] = values[BLOCK * i : BLOCK * (i + 1)].reshape(6, 6)
        return matrices

    def loads(self, t, lam, dx, dv):
        """Loads F - H^T lam of the bodies, displaced by dx and faster by dv (6 b,) than at the last place."""
        system, work = self.context.system, self.context.work
        q, qd = work.q.copy(), work.qd.copy()
        for b, (i, length) in enumerate(system.bodies):
            q[i : i + 3] += dx[6 * b : 6 * b + 3]
            qd[i : i + 3] += dv[6 * b : 6 * b + 3]
            if length == 7:
                p, pd, turn = q[i + 3 : i + 7], qd[i + 3 : i + 7], dx[6 * b + 3 : 6 * b + 6]
                omega, half = 2.0 * _G(p) @ pd + dv[6 * b + 3 : 6 * b + 6], 0.5 * np.linalg.norm(turn)
                q[i + 3 : i + 7] = np.cos(half) * p + 0.5 * np.sinc(half / np.pi) * _G(p).T @ turn
                qd[i + 3 : i + 7] = 0.5 * _G(q[i + 3 : i + 7]).T @ omega
        m, n = len(lam), q.size
        Phi, Phi_q, Phi_t, gamma, Q = np.zeros(m), np.zeros((m, n)), np.zeros(m), np.zeros(m), np.zeros(n)
        evaluate_constraints(system, q, qd, t, Phi, Phi_q, Phi_t, gamma)
        _forces(system, q, qd, t, Q)
        Q -= Phi_q.T @ lam
        parts = [(Q[i : i + 3], 0.5 * _G(q[i + 3 : i + 7]) @ Q[i + 3 : i + 7] if k == 7 else np.zeros(3))
                 for i, k in system.bodies]  # fmt: skip
        return np.concatenate([part for pair in parts for part in pair])


def _G(p):
    e0, e1, e2, e3 = p
    return np.array([[-e1, e0, e3, -e2], [-e2, -e3, e0, e1], [-e3, e2, -e1, e0]])
