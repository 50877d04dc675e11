"""Frictions at given states: slip velocities, normal loads, forces for unit loads; kernels, and their workspace."""

import math
import threading

import numpy as np

from ..elements.bodies import transform_g
from ..elements.loops.friction import DERIVE, HERE
from ..elements.loops.template import turning
from ..formulations.accelerations import normal_load, unit_friction
from ..jit.kernels import entry, kernel, resident, stack
from ..maths.vectors import rotate
from ..model.equations import evaluate_constraints, recall, set_time
from ..model.handles import index_of
from ..model.packed import coupled_loads
from ..observables.generalised_forces import sum_forces
from ..observables.reactions import solve_multipliers, solve_normal_loads
from ..rows.constraint_graph import REDUCED, graph_of
from ..workspaces import load_parts, parts
from .contact_rows import find_reactions

# Of a unit in the table: where the coordinates of a and b begin, and how many they are (none of the ground); whether
# bodies turn on one another; what becomes of the component along an axis of a, or a normal of b.
AT_A, SIZE_A, AT_B, SIZE_B, TURNS, PART, INTS = range(7)
WHOLE, ALONG, ACROSS = 0, 1, 2  # parts of the velocity: all of it, along the axis of a, across the normal of b


@kernel
def _moved(at, size, q, qd, r, v, w):
    """Centroid, its velocity and the angular velocity of a body, ground frame; zeros of the ground."""
    for i in range(3):
        r[i] = q[at + i] if size > 0 else 0.0
        v[i] = qd[at + i] if size > 0 else 0.0
        w[i] = 0.0
    if size == 7:
        turning(q[at + 3 : at + 7], qd[at + 3 : at + 7], w)


@kernel
def _turned(at, size, q, s, out):
    """A direction of a body, ground frame."""
    if size == 7:
        rotate(q[at + 3 : at + 7], s, out)
    else:
        for i in range(3):
            out[i] = s[i]


@kernel
def slip_velocity(q, qd, one, point, axis, v, n):
    """Slip velocity or rate v, axis n (3,), ground frame, of a unit of the table; the size of the terms of v.

    v = v_a + w_a x s - v_b - w_b x (x_a - r_b), or w_a - w_b, at q, qd (n,); point s and axis: (3,).
    """
    ra, va, wa, rb, vb, wb = stack(3), stack(3), stack(3), stack(3), stack(3), stack(3)
    s, d, size = stack(3), stack(3), 0.0
    _moved(one[AT_A], one[SIZE_A], q, qd, ra, va, wa)
    _moved(one[AT_B], one[SIZE_B], q, qd, rb, vb, wb)
    # v = w_a - w_b, or v_a + w_a x s - v_b - w_b x d with d = r_a + s - r_b
    if one[TURNS]:
        for i in range(3):
            v[i] = wa[i] - wb[i]
            size += abs(wa[i]) + abs(wb[i])
    else:
        _turned(one[AT_A], one[SIZE_A], q, point, s)
        for i in range(3):
            d[i] = ra[i] + s[i] - rb[i]
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            va[i] += wa[j] * s[m] - wa[m] * s[j]
            vb[i] += wb[j] * d[m] - wb[m] * d[j]
            size += abs(va[i]) + abs(vb[i]) + abs(wa[j] * s[m]) + abs(wb[j] * d[m])
        for i in range(3):
            v[i] = va[i] - vb[i]
    # Its part along the axis n of a, (v.n) n, or across the normal n of b, v - (v.n) n
    if one[PART] == WHOLE:
        return size
    if one[PART] == ALONG:
        _turned(one[AT_A], one[SIZE_A], q, axis, n)
    else:
        _turned(one[AT_B], one[SIZE_B], q, axis, n)
    along = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    for i in range(3):
        v[i] = along * n[i] if one[PART] == ALONG else v[i] - along * n[i]
    return size


@kernel
def within(v, d, signed):
    """Component of v along a direction d; in a plane, where not signed, zero where v is 60 degrees off.

    v.d - |v - (v.d) d| / sqrt(3)

    Of a slip that comes to rest without turning it is as smooth as v, which its size is not.
    """
    along, square = 0.0, 0.0
    for i in range(d.size):
        along += v[i] * d[i]
    if signed:
        return along
    for i in range(d.size):
        across = v[i] - along * d[i]
        square += across * across
    return along - math.sqrt(square / 3.0)


@entry("mmwvvmmm")
def slip_velocities(q, qd, table, points, axes, v, sizes, n):
    """The same v, n (k, 3 units) and sizes (k, units) of all units at q, qd (k, n)."""
    for k in range(q.shape[0]):
        for u in range(sizes.shape[1]):
            one, o = table[INTS * u : INTS * (u + 1)], slice(3 * u, 3 * u + 3)
            sizes[k, u] = slip_velocity(q[k], qd[k], one, points[o], axes[o], v[k, o], n[k, o])


@entry("pdvvvm")
def find_units(context, t, q, qd, memory, out):
    """out (frictions, 14): generalised forces on the coordinates of a, then of b, for unit normal loads."""
    c = load_parts(context)
    recall(c.system, memory)
    set_time(c.system, t)
    for i in range(out.shape[0]):
        unit_friction(c.system, c.graph.frictions[i], q, qd, t, out[i])


@entry("pvmm")
def find_loads(context, q, reactions, out):
    """out (frictions, 7): normal loads of reactions (frictions, 6), and their derivatives by these.

    Reactions: force, ground frame, and torque about the centroid, body frame.
    """
    c = load_parts(context)
    for i in range(out.shape[0]):
        normal_load(c.system, c.tangent, c.graph.frictions[i], q, DERIVE | HERE, reactions[i], out[i])


KERNELS = (
    find_units, find_loads, slip_velocities, sum_forces, evaluate_constraints, solve_normal_loads, solve_multipliers,
    find_reactions,
)  # fmt: skip


def normal_loads_of(packed, t, q, qd, memory, Phi_q):
    """The `NormalLoads` of a packed scene in this thread, at one state."""
    known, key = packed.derived.reactions, (threading.get_ident(), NormalLoads)
    if key not in known:
        known[key] = NormalLoads(packed, q.size)
    known[key].enter(t, q, qd, memory, Phi_q)
    return known[key]


class NormalLoads:
    """Frictions of a packed scene that depend on reactions, at one state at a time.

    Parameters
    ----------
    packed : Packed
    n : int
        Coordinates.

    Attributes
    ----------
    units : ndarray (frictions, n)
        Generalised forces for unit normal loads.
    """

    def __init__(self, packed, n):
        own = packed.system._replace(reals=packed.system.reals.copy())
        self.context, *self._keep = resident(parts(own, graph_of(packed, REDUCED), n))
        loads, spans = coupled_loads(packed), packed.system.bodies.tolist()
        count, members = len(loads), {id(member.constraint): member.rows for member in packed.members}
        # Where the forces on both bodies are, behind the last coordinate of the ground; of a joint the rows, padded
        self._at, self._on = np.full((count, 14), n), np.zeros((count, 2), int)
        rows = [np.r_[members[id(load.force.joint)]] for load in loads]
        self._m = len(packed.system.segments)
        self._rows = np.full((count, max(map(len, rows))), self._m)
        for i, load in enumerate(loads):
            self._rows[i, : len(rows[i])] = rows[i]
            for k, body in enumerate((load.force.a, load.force.b)):
                if body.dimension:
                    at, length = spans[index_of(packed, body)]
                    self._at[i, 7 * k : 7 * k + length] = np.arange(at, at + length)
            self._on[i] = spans[index_of(packed, load.force.on)]
        self._rigid = self._on[:, 1] == 7
        self.units = np.zeros((count, n))

    def enter(self, t, q, qd, memory, Phi_q):
        """Take a state, and Phi_q (m, n) there."""
        self._q, found, count = q, np.zeros((len(self.units), 14)), len(self.units)
        find_units(self.context, t, q, qd, memory, found)
        units = np.zeros((count, q.size + 1))
        np.put_along_axis(units, self._at, found, 1)
        self.units = units[:, :-1].copy()
        # The reaction on a body by the multipliers of the joint: -Phi_r^T lam, and -G Phi_p^T lam / 2
        Phi_q, at, rigid = np.vstack([Phi_q, np.zeros(q.size)]), self._on[:, :1], self._rigid
        self._wrench = np.zeros((count, 6, self._rows.shape[1]))
        self._wrench[:, :3] = -Phi_q[self._rows[:, None], (at + np.arange(3))[:, :, None]]
        p = at[rigid] + np.arange(3, 7)
        self._wrench[rigid, 3:] = -0.5 * transform_g(q[p]) @ Phi_q[self._rows[rigid, None], p[:, :, None]]

    def reactions(self, lam):
        """Reactions (frictions, 6, ...) by multipliers (rows, ...) of the joints' rows, which are the first ones."""
        padded = np.zeros((self._m + 1, *lam.shape[1:]))
        padded[: len(lam)] = lam
        return self._wrench @ padded[self._rows]

    def changed(self, reactions, lam):
        """Normal loads (frictions,) of these reactions (frictions, 6) and of more multipliers (rows,)."""
        return self.loads(reactions + self.reactions(lam[:, None])[..., 0])[0]

    def loads(self, reactions):
        """Normal loads (frictions,) of reactions (frictions, 6), and their derivatives by these."""
        out = np.zeros((len(reactions), 7))
        find_loads(self.context, self._q, reactions, out)
        return out[:, 0], out[:, 1:]
