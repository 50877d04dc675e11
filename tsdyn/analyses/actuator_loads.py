"""Inverse dynamics: loads u of actuators, and multipliers, for a motion q, qd, qdd."""

from collections import Counter
from typing import NamedTuple

import numpy as np

from ..elements.bodies import IDENTITY, rotation_matrix
from ..elements.element import AngleGeometry
from ..elements.force import Force
from ..elements.loads import JointLoad
from ..errors import InvalidArgument, SingularConfiguration
from ..forces.point_force import PointForce
from ..forces.spring import Spring
from ..forces.torque import Torque
from ..maths.tolerances import NEGLIGIBLE, TINY
from ..model import handles as joint_motion
from ..model.equations import WIDTH, as_csr, with_short_rows
from ..motions.signals import Signal
from ..observables import reactions
from ..observables.evaluate import balance, constraint_arrays, mass_matrix_sparse, normal_loads
from ..observables.generalised_forces import force_loads, inertial_forces, velocity_forces
from ..validation import sequence
from .coordinates import AXES, arm_by_parameters, item_of, named_coordinates, transform_e
from .nominal_motion import roots_of_masses
from .tolerances import ACCEPTED, CONSISTENT, DELTA, DENSE_INSTANT, REGULARISED_SWEEPS

# Generalised forces of unit loads along a motion q (k, n): each as columns (c,) of q and values (k, c).
#
# A force F at a point s is F on r and (A s)_p^T F on p, a torque n is 2 E^T n on p, both in the ground frame.


class UnitLoads:
    """Unit loads on the bodies and joints of `handles` at positions q (k, n)."""

    def __init__(self, handles, q):
        self.handles, self.q = handles, q

    def angle(self, geometry):
        """A torque along an angle: on the other body about the axis f x g, the opposite on the own one."""
        axis = self._direction(geometry.own, np.cross(geometry.f, geometry.g))
        return _joined(self.torque(geometry.other, axis), self.torque(geometry.own, -axis))

    def displacement(self, geometry):
        """A force along a displacement: on the other body's point, the opposite on the own one's, and its moment."""
        own, other = geometry.own, geometry.other
        e = self._direction(own, geometry.e)
        ends = self._position(own, geometry.s_own), self._position(other, geometry.s_other)
        moment = self.torque(own, np.cross(e, ends[1] - ends[0]))
        return _joined(self.force(other, geometry.s_other, e), self.force(own, geometry.s_own, -e), moment)

    def tension(self, spring):
        """A pull between the points of a spring."""
        (s_a, s_b), (a, b) = spring.coordinates, (spring.a, spring.b)
        d = self._position(b, s_b) - self._position(a, s_a)
        d = d / np.linalg.norm(d, axis=1)[:, None]
        return _joined(self.force(a, s_a, d), self.force(b, s_b, -d))

    def component(self, item, e):
        """A force or torque of PointForce or Torque along an axis e of its frame; torques have no point."""
        e = np.tile(e, (len(self.q), 1)) if item.frame == "ground" else self._direction(item.a, e)
        point = getattr(item, "point_a", None)
        return self.torque(item.a, e) if point is None else self.force(item.a, point, e)

    def force(self, body, s, F):
        """F (k, 3) at a point s."""
        at, dimension = self._where(body)
        arm = arm_by_parameters(self._parameters(body), np.asarray(s, float))
        values = np.concatenate((F, np.einsum("ki,kij->kj", F, arm)), axis=1)
        return np.arange(at, at + dimension), values[:, :dimension]

    def torque(self, body, n):
        """A torque (k, 3)."""
        at, dimension = self._where(body)
        if dimension != 7:
            return np.zeros(0, int), np.zeros((len(n), 0))
        return np.arange(at + 3, at + 7), 2.0 * np.einsum("ki,kij->kj", n, transform_e(self._parameters(body)))

    def _where(self, body):
        """Where the coordinates of a body are; of a handle of another scene of the family, too."""
        return self.handles.where(self.handles.own(body))

    def _parameters(self, body):
        at, dimension = self._where(body)
        return self.q[:, at + 3 : at + 7] if dimension == 7 else np.tile(IDENTITY, (len(self.q), 1))

    def _direction(self, body, s):
        return rotation_matrix(self._parameters(body)) @ np.asarray(s, float)

    def _position(self, body, s):
        at, dimension = self._where(body)
        if dimension == 3:
            return self.q[:, at : at + 3]
        return self._direction(body, s) + (self.q[:, at : at + 3] if dimension else 0.0)


def _joined(*loads):
    columns, values = zip(*loads, strict=True)
    return np.concatenate(columns), np.concatenate(values, axis=1)


# Actuators, and the inputs of `scene.linearise`: their names, units, and generalised forces along a motion.
#
# JointTorque and JointForce, joints, PointForce, Torque, springs.

NEWTON, NEWTON_METRE = "N", "N m"


class Actuator(NamedTuple):
    """One load, along a motion of k instants."""

    name: str
    unit: str
    item: object  # of the scene whose numbers vary
    columns: np.ndarray  # (c,) of q
    loads: np.ndarray  # (k, c)  generalised forces of a unit of it
    whole: str = ""  # the load of which it is a component, where all of them were asked for

    def rate(self, qd):
        """What its power is the product with (k,): a velocity or an angular velocity."""
        return np.einsum("kc,kc->k", self.loads, qd[:, self.columns])


def actuators_of(scene, handles, given, q, what="actuator"):
    """The `Actuator`s of handles and names along q (k, n); what has no load to give is refused, as no `what`."""
    given = sequence(given, f"{what}s must be a sequence of handles or names, such as [motor]", InvalidArgument)
    units, coordinates, found = UnitLoads(handles, q), named_coordinates(handles), []
    constraints = [row.item for row in handles.rows if not isinstance(row.item, Force)]
    by_name = {name: (item, geometry) for item in constraints for name, geometry in coordinates[id(item)]}
    for one in given:
        if isinstance(one, str) and one in by_name:
            item, geometry = by_name[one]
            found.append(_of_coordinate(units, one, item, geometry))
            continue
        item, axis = item_of(scene, one, [*scene.forces, *scene.constraints], "force or joint")
        every = _of_item(units, coordinates, item, what)
        same = [each for each in every if axis is None or each.name.endswith(axis)]
        if not same:
            names = ", ".join(repr(each.name) for each in every)
            raise InvalidArgument(f"{item.name!r} has no component {axis[1:]!r}: its {what} is {names}.")
        own = {"item": handles.own(item), "whole": item.name if len(same) > 1 else ""}
        found += [each._replace(**own) for each in same]
    for name, count in Counter(each.name for each in found).items():
        if count > 1:
            raise InvalidArgument(f"{what}s: {name} is given more than once, or several have this name.")
    return found


def _of_coordinate(units, name, item, geometry):
    turns = isinstance(geometry, AngleGeometry)
    load = (units.angle if turns else units.displacement)(geometry)
    return Actuator(name, NEWTON_METRE if turns else NEWTON, item, *load)


def _of_item(units, coordinates, item, what):
    if isinstance(item, JointLoad):
        return [_of_coordinate(units, item.name, item, item.geometry)]
    if isinstance(item, Spring):
        return [Actuator(item.name, NEWTON, item, *units.tension(item))]
    if isinstance(item, (PointForce, Torque)):
        unit = NEWTON if isinstance(item, PointForce) else NEWTON_METRE
        axes = zip(AXES, np.eye(3), strict=True)
        return [Actuator(item.name + axis, unit, item, *units.component(item, e)) for axis, e in axes]
    found = [] if isinstance(item, Force) else coordinates.get(id(units.handles.own(item)), [])
    if not found:
        raise InvalidArgument(
            f"{item.name}: a {type(item).__name__} is no {what}. {what.capitalize()}s are JointTorque and JointForce, "
            "PointForce and Torque (three components), the actuator of a Spring, and joints with an angle or a "
            "displacement, for the torque or force along it. In place of a motor that prescribes a motion use a "
            "JointTorque or JointForce."
        )
    return [_of_coordinate(units, name, item, geometry) for name, geometry in found]


def tension_given(load, t):
    """The tension of the actuator that a spring has by itself, (k,)."""
    given = load.parameters[3]
    return given.over(t)[0] if isinstance(given, Signal) else np.full(t.size, float(given))


# Loads and multipliers of one instant, the loads as small as can be.
#
#     [ -delta M   H^T   -B ] [ mu  ]   [ d ]
#     [  H         0      0 ] [ lam ] = [ 0 ]        u = B^T mu,    H: independent rows of Phi_q
#     [ -B^T       0      I ] [ u   ]   [ 0 ]
#
# delta is zero, unless actuators can't move the scene in every direction: then a small one leaves what they can't give,
# M delta mu, to be refused if it is more than rounding. Matrices are dense, or sparse for many bodies.


class Instant:
    """The equations of one instant."""

    def __init__(self, system, at, Phi_q, kept, B):
        self.t, q = self.at = at
        self.Phi_q, self.kept, self.B, self.H = Phi_q, kept, B, Phi_q[kept]
        self.system, self.q, self.root = system, q, roots_of_masses(system, q.size)
        self.carried, self.u, self._factors = np.zeros(q.size), None, {}
        self._left, self._delta = np.zeros(q.size), 0.0

    def solve(self, load):
        """(mu, lam) of a load d (n,), lam (m,) with NaN for redundant rows; u of it is kept."""
        n, m = load.size, self.kept.size
        for delta in (0.0, DELTA * float((self.B * self.B).sum(axis=0).max() or 1.0)):
            self._delta = delta
            x = self._refined(load)
            if x is None:
                continue
            largest = max(np.abs(part / self.root**2).max() for part in (load, self.carried))
            if delta or np.abs(self._left / self.root**2).max() <= ACCEPTED * largest:
                lam = np.full(self.Phi_q.shape[0], np.nan)
                lam[self.kept], self.u = x[n : n + m], x[n + m :]
                return np.concatenate((x[:n], lam))
        raise SingularConfiguration(
            f"inverse_dynamics: Phi_q has lost rank at t = {self.t:g} s, a singular configuration, where loads are not "
            "determined. Leave this time out."
        )

    def effect(self, j):
        """Accelerations by a unit load under the constraints, over those without them."""
        b = self.B[:, [j]] if isinstance(self.B, np.ndarray) else self.B[:, [j]].toarray()
        solve = Instant(self.system, self.at, self.Phi_q, self.kept, self.B[:, :0])._factorised(1.0)
        if solve is None:
            return 1.0
        gains, alone = solve(b[:, 0])[: self.q.size] * self.root, b[:, 0] / self.root
        return np.abs(gains).max() / max(np.abs(alone).max(), TINY)

    def missing(self, load):
        """Accelerations (n,) that the actuators can't give."""
        if not self._delta:
            return self._left / self.root**2
        return self._delta * self._factor()(self._left)[: load.size]

    def _refined(self, load):
        solve = self._factor()
        if solve is None:
            return None
        x, n, m = 0.0, load.size, self.kept.size
        self._left = load
        for _ in range(1 + REGULARISED_SWEEPS):
            x = x + solve(self._left)
            self.carried = self.H.T @ x[n : n + m]
            self._left = load - self.carried + self.B @ x[n + m :]
        return x if np.isfinite(x).all() else None

    def _factor(self):
        """Return solve(d) by a factorisation, None where the matrix is singular."""
        if self._delta not in self._factors:
            self._factors[self._delta] = self._factorised(self._delta)
        return self._factors[self._delta]

    def _factorised(self, delta):
        """The same of the matrix with scaled rows and columns: unit masses, unit rows of H."""
        dense, a = isinstance(self.H, np.ndarray), self.B.shape[1]
        H, B = _scaled(self.H, self.root, axis=1), _scaled(self.B, self.root, axis=0)
        lengths = np.maximum(np.sqrt((H * H).sum(axis=1)), TINY)
        H, M = _scaled(H, lengths, axis=0), None
        if delta:
            M = mass_matrix_sparse(self.system, self.q)
            M = -delta * _scaled(_scaled(M.toarray() if dense else M, self.root, axis=0), self.root, axis=1)
        weights = np.concatenate((1.0 / self.root, 1.0 / lengths, np.ones(a)))
        solve = (_dense_factors if dense else _sparse_factors)(M, H, B)
        if solve is None:
            return None
        zeros = np.zeros(len(lengths) + a)
        return lambda d: weights * solve(weights * np.concatenate((d, zeros)))


def _scaled(A, sizes, axis):
    """Rows (axis 0) or columns of a matrix divided by their sizes."""
    if isinstance(A, np.ndarray):
        return A / (sizes[:, None] if axis == 0 else sizes)
    from scipy.sparse import diags_array

    unit = diags_array(1.0 / sizes)
    return unit @ A if axis == 0 else A @ unit


def _dense_factors(M, H, B):
    from scipy.linalg.lapack import dgetrf, dgetrs

    (m, n), a = H.shape, B.shape[1]
    A = np.zeros((n + m + a, n + m + a), order="F")
    if M is not None:
        A[:n, :n] = M
    A[:n, n : n + m], A[n : n + m, :n] = H.T, H
    A[:n, n + m :], A[n + m :, :n] = -B, -B.T
    A[range(n + m, n + m + a), range(n + m, n + m + a)] = 1.0
    factors, pivots, failed = dgetrf(A, overwrite_a=True)
    return None if failed else lambda right: dgetrs(factors, pivots, right)[0]


def _sparse_factors(M, H, B):
    from scipy.sparse import block_array, eye_array
    from scipy.sparse.linalg import splu

    blocks = [[M, H.T, -B], [H, None, None], [-B.T, None, eye_array(B.shape[1])]]
    try:
        return splu(block_array(blocks, format="csc")).solve
    except RuntimeError:
        return None


# Inverse dynamics: loads u of actuators, and multipliers, for a motion q, qd, qdd.
#
#     Phi_q^T lam - B u = d,    d = Q_A + Q_v - M qdd
#
# Q_A has the forces that are no actuators. Where actuators are more than degrees of freedom, |u| is least (`Instant`).
# Many bodies take sparse matrices, so the cost is O(N) for chains and trees.


class Loads(NamedTuple):
    """What drives a motion, at k instants."""

    u: np.ndarray  # (k, actuators)
    multipliers: np.ndarray  # (k, m) NaN for redundant rows
    normals: np.ndarray  # (k, frictions)  normal loads of friction that depends on reactions
    missing: np.ndarray  # (k, n) accelerations that the actuators can't give
    scale: np.ndarray  # (k,) m/s^2, of accelerations, that those are compared with


def given_loads(packed, t, q, qd, memory, actuators):
    """Q_A (k, n) of gravity and forces; of actuators only the law of a spring, without its tension."""
    items = {id(one.item) for one in actuators}
    system = packed.system
    own = [load.alone for load in packed.loads if load.normal < 0 and not _replaced(load, items)]
    forces = np.concatenate(own) if own else system.forces[:0]
    Q = force_loads(system._replace(forces=forces), t, q, qd, memory)
    Q[:, system.bodies[:, :1] + np.arange(3)] += system.mass[:, None] * system.gravity
    for load in packed.loads:
        for one in actuators:
            if one.item is load.force and not _replaced(load, items):
                Q[:, one.columns] -= tension_given(load, t)[:, None] * one.loads
    return Q


def _replaced(load, items):
    """Whether an actuator's load takes the place of this one wholly; a spring keeps its stiffness and damping."""
    return id(load.force) in items and not hasattr(load.force, "stiffness")


def find_loads(packed, t, q, qd, qdd, memory, actuators):
    """The `Loads` of a motion (k, n)."""
    sparse = q.shape[1] > DENSE_INSTANT
    system = with_short_rows(packed) if sparse else packed.system
    d = given_loads(packed, t, q, qd, memory, actuators) + velocity_forces(packed.system, q, qd)
    inertia = inertial_forces(packed.system, q, qdd)
    kept = ~np.isnan(reactions.multipliers(packed, t, q, qd, qdd, _plain(packed, t, memory)))
    kept[~kept.any(axis=1)] = True  # Phi_q has lost rank
    k, a, m = t.size, len(actuators), kept.shape[1]
    frictions = packed.system.normals.size
    found = Loads(np.zeros((k, a)), np.full((k, m), np.nan), np.zeros((k, frictions)), np.zeros_like(q), np.zeros(k))
    for i in range(k):
        Phi_q = constraint_arrays(system, q[i], qd[i], t[i], WIDTH if sparse else None)[1]
        B = (_sparse if sparse else _dense)(actuators, i, q.shape[1])
        Phi_q = as_csr(packed, Phi_q) if sparse else Phi_q
        instant = Instant(packed.system, (t[i], q[i]), Phi_q, np.flatnonzero(kept[i]), B)
        load = d[i] - inertia[i]
        if frictions:
            friction, found.normals[i] = _friction(packed, t[i], q[i], qd[i], memory[i], instant, load)
            load = load + friction
        found.multipliers[i] = instant.solve(load)[q.shape[1] :]
        found.u[i], found.missing[i] = instant.u, instant.missing(load)
        found.scale[i] = max(np.abs(part / instant.root**2).max() for part in (d[i], inertia[i], instant.carried))
    if k:
        _demand_effective(instant, actuators, np.abs(found.u).max(axis=0))
    return found


def _demand_effective(instant, actuators, used):
    """Refuse an actuator whose loads the constraints take up, as along a coordinate that a motor drives.

    Only those that aren't used, (actuators,), may be such.
    """
    idle = {id(one.item) for one in actuators} - {
        id(one.item) for one, u in zip(actuators, used, strict=True) if u > ACCEPTED * used.max()
    }
    which = [j for j, one in enumerate(actuators) if id(one.item) in idle]
    effective = {id(actuators[j].item) for j in which if instant.effect(j) > NEGLIGIBLE}
    for j in which:
        if id(actuators[j].item) not in effective:
            raise InvalidArgument(
                f"inverse_dynamics: the actuator {actuators[j].name} does no work on any motion that the constraints "
                "admit. If a motor prescribes its coordinate, remove the motor, and give its motion in the dict."
            )


def _friction(packed, t, q, qd, memory, instant, load):
    """Friction that depends on reactions (n,), in balance with them, and its normal loads."""
    friction, x = balance(packed, float(t), q, qd, instant.Phi_q, lambda more: instant.solve(load + more), memory)
    return friction, normal_loads(packed, float(t), q, qd, instant.Phi_q, np.nan_to_num(x[q.size :]))[0]


def _plain(packed, t, memory):
    """Memory with normal loads of zero: which rows are redundant doesn't depend on them."""
    return np.hstack((memory, np.zeros((t.size, packed.system.normals.size))))


def _dense(actuators, i, n):
    """B (n, actuators) at instant i."""
    B = np.zeros((n, len(actuators)))
    for j, one in enumerate(actuators):
        np.add.at(B[:, j], one.columns, one.loads[i])
    return B


def _sparse(actuators, i, n):
    """The same as a SciPy sparse array."""
    from scipy.sparse import csc_array

    columns = [one.columns for one in actuators]
    places = np.concatenate(columns), np.repeat(np.arange(len(actuators)), [c.size for c in columns])
    return csc_array((np.concatenate([one.loads[i] for one in actuators]), places), (n, len(actuators)))


def demand_produced(solution, actuators, found):
    """The share (k,) of accelerations that actuators can't give; a motion with more than rounding is refused."""
    share = np.abs(found.missing).max(axis=1, initial=0.0) / np.maximum(found.scale, TINY)
    if not share.max(initial=0.0) <= CONSISTENT:
        i = int(np.nan_to_num(share, nan=np.inf).argmax())
        name, value = _largest_missing(solution, solution.q[i], found.missing[i])
        raise InvalidArgument(
            f"inverse_dynamics: {', '.join(one.name for one in actuators)} can't produce this motion: at t = "
            f"{solution.t[i]:.6g} s {name} gets {abs(value):.4g} of its acceleration (m/s^2 or rad/s^2) from no "
            f"actuator, {share[i]:.1e} of the largest. Add an actuator that moves it, or give a motion that it makes "
            "by itself, such as that of a Solution."
        )
    return share


def _largest_missing(solution, q, missing):
    """Name and value of the coordinate with the largest acceleration among (n,): of a joint, or else of a body."""
    handles, levels = solution.handles, (q, np.zeros_like(q), missing)
    found, named = [], named_coordinates(handles)
    for row in handles.rows:
        for name, geometry in named[id(row.item)]:
            evaluate = joint_motion.angle if isinstance(geometry, AngleGeometry) else joint_motion.displacement
            found.append((name, float(evaluate(geometry, *handles.motions(geometry, levels), 2))))
    if not found:
        at = [handles.where(body)[0] for body in handles.bodies]
        found = [
            (body.name, float(np.linalg.norm(missing[i : i + 3]))) for body, i in zip(handles.bodies, at, strict=True)
        ]
    return max(found, key=lambda pair: abs(pair[1]))
