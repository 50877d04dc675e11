"""Loads, constraint rows and multipliers at a configuration at rest.

    [ G    A^T ] [ y   ]     [ Q       ]
    [ A    0   ] [ lam ]  =  [ 0       ]            Q - A^T lam = G y is left over

G weighs turns by one and shifts by next to nothing, as if bodies had no mass: forces pass through joints at once, as
they do at rest, and are left over where nothing but inertia would take them up. Corrections of positions by the same
factors shift bodies rather than turn them, which closes trees of joints in one sweep.
"""

from functools import cached_property

import numpy as np

from ..errors import SingularConfiguration
from ..maths.sparse_lu import sparse_lu
from ..model.sparse_jacobian import WIDTH, as_csr
from ..observables.evaluate import NOT_UNIQUE, constraint_arrays
from ..observables.generalised_forces import applied_loads
from .quadratic import Quadratic
from .tolerances import CLOSED, LEAST_DIVISOR, MOST_SWEEPS, REFINEMENTS, SINGULAR, SLOWEST, STALLED, TURNED


class Rest:
    """A consistent configuration at rest.

    Parameters
    ----------
    frame : Frame
    memory : ndarray (slots,)
        Memory of forces and constraints.
    q : ndarray (n,)

    Attributes
    ----------
    load, left : ndarray (size,)
        Generalised forces by `Increments`, N m, and what the constraints leave of them.
    lam : ndarray (m,)
        Multipliers of Phi, zero for redundant rows.
    """

    def __init__(self, frame, memory, q):
        self.frame, self.memory, self.q, self.t = frame, memory, q, frame.t
        self.qd, self.qdd = self._rates()
        self.system = frame.system._replace(reals=frame.system.reals.copy())
        self.system.reals[self.system.memory] = memory
        self.P = frame.increments.at(q)
        self.Phi, rows, _, _ = constraint_arrays(self.system, q, np.zeros(q.size), self.t, WIDTH)
        self.rows = rows
        A = frame.transformed_rows(self.P, rows[frame.own])
        self.left_out = frame.left_out(A, q)
        A = np.where(self.left_out[frame.rows.rows], 0.0, A)
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, frame.own.size))
        self.lengths = np.where(self.left_out, 1.0, np.maximum(lengths, LEAST_DIVISOR))
        self.A = A / self.lengths[frame.rows.rows]
        self.Q = self.loads_at(q)
        self.load = frame.increments.load(self.P, self.Q)
        self._factor()
        self.forces = self.solve(self.load, np.zeros(frame.own.size))[1]
        self.left = self.load - frame.rows.matrix(self.A).T @ self.forces
        self.lam = np.zeros(len(self.Phi))
        self.lam[frame.own] = self.forces / self.lengths
        self._press()

    def _rates(self):
        """qd and qdd (n,)."""
        return np.zeros((2, self.q.size))

    def _press(self):
        """Multipliers of the normalisations: no residual along p."""
        frame, p = self.frame, self.frame.metric.p
        if len(p):
            left = self.Q - self.reactions
            at = np.zeros(len(self.frame.metric.at) + 1, int)
            at[:-1][frame.metric.rigid] = p[:, 0]
            places = at[frame.normal_bodies[:, None]] + np.arange(4)
            self.lam[frame.normals] = (left[places] * self.q[places]).sum(axis=1)

    @property
    def reactions(self):
        """Phi_q^T lam (n,) of rows of Phi, (n,)."""
        return as_csr(self.frame.packed, self.rows).T @ self.lam

    def _factor(self):
        frame = self.frame
        pattern, top, (i, j), diagonal = frame.weights
        self._weights = 1.0 / np.sqrt(diagonal)
        A = self.A * self._weights[frame.rows.columns]
        lengths = np.sqrt(np.bincount(frame.rows.rows, A * A, frame.own.size))
        self._scales = 1.0 / np.where(self.left_out, 1.0, np.maximum(lengths, LEAST_DIVISOR))
        A = A * self._scales[frame.rows.rows]
        self._matrix = frame.matrix(pattern, top * self._weights[i] * self._weights[j], A, self.left_out * 1.0)
        try:
            self._factors = sparse_lu(self._matrix)
        except RuntimeError as error:
            raise SingularConfiguration(NOT_UNIQUE) from error
        pivots = np.abs(self._factors.U.diagonal())
        if pivots.min(initial=np.inf) < SINGULAR * pivots.max(initial=0.0):
            raise SingularConfiguration(NOT_UNIQUE)

    def solve(self, load, bias):
        """The (y, lam) with G y + A^T lam = load and A y = bias."""
        size = load.size
        right = np.concatenate((self._weights * load, self._scales * np.where(self.left_out, 0.0, bias)))
        found = self._factors.solve(right)
        for _ in range(REFINEMENTS):
            found = found + self._factors.solve(right - self._matrix @ found)
        return self._weights * found[:size], self._scales * found[size:]

    @property
    def unbalanced(self):
        """The largest acceleration by the residual loads, m/s^2, over that by the loads alone."""
        return float(self._largest(self.left) / self.acceleration_scale)

    @property
    def gains(self):
        """Accelerations (b, 3), m/s^2, and of turns (b', 3), rad/s^2, by residual loads, on bodies without joints."""
        return self.frame.increments.accelerations(self.left)

    @property
    def fastest(self):
        """The body with the largest residual acceleration, and that acceleration: for messages."""
        shifts, spins = (np.linalg.norm(each, axis=1) for each in self.gains)
        turns = np.zeros(len(shifts))
        turns[self.frame.metric.rigid] = spins
        worst = int((shifts + self.frame.reach * turns).argmax())
        shift, turn = shifts[worst], turns[worst]
        much = f"{shift:.3g} m/s^2" if shift >= self.frame.reach * turn else f"{turn:.3g} rad/s^2"
        return f"without its joints {self.frame.packed.bodies[worst].name} would accelerate by {much}"

    def _largest(self, load):
        shifts, turns = self.frame.increments.accelerations(load)
        return max(np.abs(shifts).max(initial=0.0), self.frame.reach * np.abs(turns).max(initial=0.0))

    @cached_property
    def acceleration_scale(self):
        """The acceleration, m/s^2, that others are compared with; a spring stretched by the reach is one of them."""
        reach = self.frame.reach
        loads = self._largest(self.load), self._largest(self.frame.rows.matrix(self.A).T @ self.forces)
        return max(*loads, float(np.abs(self.system.gravity).max()), self.quadratic.rate * reach) or 1.0

    @cached_property
    def quadratic(self):
        """The `Quadratic` of the work along increments."""
        return Quadratic(self)

    def closed(self, q, correction=None):
        """The consistent configuration next to q, by corrections with factors at hand; None where there is none."""
        allowed, correction = 1.0 + np.abs(q).max(), correction or self._shifted
        q, size = self._swept(q, correction, CLOSED * allowed)
        if size <= TURNED * allowed:
            return q
        return self.frame.closed(q) if size <= STALLED * allowed else None

    def _swept(self, q, correction, limit):
        """Positions after sweeps of simplified Newton, and what is left of the constraints."""
        before = np.inf
        for _ in range(MOST_SWEEPS):
            Phi = self.residuals(q)
            size = np.abs(Phi).max(initial=0.0)
            if size <= limit or not size < SLOWEST * before:
                break
            before, step = size, correction(-Phi[self.frame.own] / self.lengths)
            if not np.isfinite(step).all():
                return q, np.inf
            q = self.frame.increments.moved(q, step)
        return q, size

    def _shifted(self, bias):
        """The increment u with A u = bias of least rotation."""
        return self.solve(np.zeros(self.frame.increments.size), bias)[0]

    def force_slopes(self, Q_q, Q_qd):
        """The derivative of the forces (forces, 14, 14) by q, of those by q and qd."""
        return Q_q

    def own_slopes(self):
        """Other derivatives by q of each body, (b, 7, 7)."""
        return np.zeros((len(self.frame.metric.at), 7, 7))

    def residuals(self, q):
        """Phi (m,) at other positions."""
        return constraint_arrays(self.system, q, np.zeros(q.size), self.t, WIDTH)[0]

    def loads_at(self, q):
        """The loads (n,) at other positions."""
        return self.applied(q, np.zeros(q.size))

    def applied(self, q, qd):
        """Q_A (n,)."""
        return applied_loads(self.system, np.array([self.t]), q[None], qd[None], self.memory[None])[0]
