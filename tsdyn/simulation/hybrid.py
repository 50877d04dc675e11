"""Hybrid systems: what the action of an event changes, and how the run goes on from there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..calls import fitting_methods
from ..elements.bodies import START, PointMass, named, rotation_matrix, transform_g
from ..errors import InvalidArgument, InvalidBody, SingularConfiguration
from ..maths.dense_linalg import dependent, row_lengths
from ..maths.tolerances import RANK_TOL
from ..model.handles import handles_of
from ..observables.evaluate import NO_INERTIA, constraint_arrays, mass_matrix
from ..observables.state import EventInstant, begin_memory
from ..validation import floats, listed, vector3
from .phase_scenes import NAMED, inactive_of
from .variants import family_of, packed_anew, switchable

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike, Floats, ItemLike
    from ..observables.state import State


KEPT = 9  # scenes with other parameters, and one more

# What an action may ask for.


class Push(NamedTuple):
    """An impulse of the user's on a body."""

    body: Any
    impulse: Floats  # (3,), N s, ground frame
    point: Floats  # (3,), m, body frame


@fitting_methods
class Change:
    """What the action of an event may change, at the time of the event: the argument of `event.action`.

    All that the actions of one instant ask for is carried out together, after the last of them; later on, a Change that
    was kept raises InvalidArgument.

    Attributes
    ----------
    t : float, s
        The time of the event.
    state : State
        The state there, before the change: `state.angle(joint)`, `state.velocity(body)` and so on.

    Notes
    -----
    Positions are carried over. Velocities are those nearest in the metric of kinetic energy that fulfil the constraints
    which are active then, after the impulses asked for. Constraints that become active take the impulses that
    `solution.impulses` lists.

    Examples
    --------
    A stone is kicked at the top of its flight:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> stone = scene.add_point_mass(mass=2.0, velocity=(0, 0, 5), name="stone")
    >>> def top(t, state):
    ...     return state.velocity(stone)[2]
    >>> top.action = lambda change: change.impulse(stone, (6.0, 0, 0))
    >>> solution = ts.simulate(scene, (0, 1), events=top)
    >>> print(solution.t_events[0], solution.state.position(stone).round(9) + 0.0)
    [0.5] [1.5 0.  0. ]
    """

    def __init__(self, scene: Any, t: float, state: State, inactive: Any, values: dict[str, Any]) -> None:
        self.t, self.state = t, state
        self._scene, self._inactive, self._values = scene, dict.fromkeys(inactive), dict(values)
        self._activated, self._pushes, self._ends, self._over = {}, [], False, False

    def _demand_present(self):
        """Refuse what is asked for when the actions of the instant have been called."""
        if self._over:
            raise InvalidArgument(
                f"the event at t = {self.t:.9g} s is over: ask for changes within its action, and keep what another "
                "one needs, not the Change."
            )

    def activate(self, item: ItemLike) -> None:
        """Let a constraint or force take part from now on; of one that does already, nothing changes.

        Raises
        ------
        InvalidArgument
            If the scene has no such item, or it can't come and go.

        Notes
        -----
        The run ends with an account where a row of the constraint doesn't hold at the positions of the event.
        """
        self._demand_present()
        item = switchable(self._scene, item)
        if item.name in self._inactive:
            del self._inactive[item.name]
            self._activated[item.name] = item

    def deactivate(self, item: ItemLike) -> None:
        """Leave out a constraint or force from now on; arguments and errors as of `activate`."""
        self._demand_present()
        item = switchable(self._scene, item)
        self._activated.pop(item.name, None)
        self._inactive[item.name] = None

    def set(self, parameter: str, value: Any) -> None:
        """Set a parameter of the scene for the rest of the run.

        Parameters
        ----------
        parameter : str
            Its name, as of `scene.parameters()`: "motor.torque", "gravity".
        value : float or array_like
            As of `Scene.with_parameters`.

        Raises
        ------
        InvalidArgument
            If there is no such parameter, or it belongs to the start or to the table `parameters` of a file.
        TsdynError
            If the value is inadmissible.
        """
        self._demand_present()
        field = family_of(self._scene)[0].field(parameter)
        if isinstance(field.owner, PointMass) and field.attribute in START:
            raise InvalidArgument(
                f"{parameter} belongs to the start. Change velocities by change.impulse(body, impulse)."
            )
        if "." not in parameter and parameter != "gravity":
            raise InvalidArgument(
                f"{parameter} belongs to the file. Set what follows from it, such as the length of a rod."
            )
        values = self._values | {parameter: value}
        found = with_values(self._scene, values)
        if found.system.memory.size != self._scene.system.memory.size:
            raise InvalidArgument(
                f"{parameter} can't be set within a run: forces would remember other numbers. Begin another run; a "
                "contact whose friction comes or goes is to have a small coefficient instead of none."
            )
        self._values = values

    def impulse(self, body: BodyLike, impulse: ArrayLike, point: ArrayLike | None = None) -> None:
        """Hit a body.

        Parameters
        ----------
        body : Body or str
        impulse : array_like (3,), N s
            In the ground frame.
        point : array_like (3,), m, optional
            Where it acts, in the body frame; by default the centroid.

        Raises
        ------
        InvalidBody
            If the scene has no such body.
        InvalidArgument
            If impulse or point is none.
        """
        self._demand_present()
        bodies = self._scene.bodies
        body = named(bodies, body, "body", InvalidBody) if isinstance(body, str) else body
        if not any(body is own for own in bodies):
            raise InvalidBody(f"change.impulse: {body!r} is no body of the scene.")
        impulse = vector3(impulse, "change.impulse: impulse (N s)", InvalidArgument)
        point = np.zeros(3) if point is None else vector3(point, "change.impulse: point (m)", InvalidArgument)
        if body.dimension == 3 and point.any():
            raise InvalidArgument(f"change.impulse: {body.name} is a point mass; leave out point.")
        self._pushes.append(Push(body, impulse, point))

    def end(self) -> None:
        """End the run at the event; nothing else that actions of this instant ask for is carried out."""
        self._demand_present()
        self._ends = True

    def __repr__(self) -> str:
        return f"<Change at t = {self.t:g} s>"


# How a run carries it out.


def ask(run, events, last):
    """Call the actions of events at one instant: the `Change`, or None with the reason where one fails.

    run is a `_ContactRun` at the end of a phase, last the state (3, n) there.
    """
    angles, slots = run.remembered[: run.count], run.remembered[run.count :]
    state = EventInstant(run.phases.packed[run.phases.of[-1]], slots, (run.t, last, angles), run.t, last)
    change, known = Change(run.base, run.t, state, run.inactive, run.values), (run.base.packed, inactive_of(run.base))
    for event in events:
        try:
            event.action(change)
            if _is_changed(run.base, *known):
                raise InvalidArgument(
                    "it has changed the scene, not the run; ask the Change instead: change.set, activate, deactivate, "
                    "impulse."
                )
        except Exception as error:
            said = str(error)
            end = "" if said.endswith((".", "?", "!")) else "."
            run.reason = f"The action of {event.name} raised {type(error).__name__} at t = {run.t:.9g} s: {said}{end}"
            return None
    change._over = True
    return change


def _is_changed(scene, packed, inactive):
    """Whether a scene isn't what it was, but for its start."""
    from .stored_runs import hash_of

    other = scene._packed is not packed
    return other and (inactive_of(scene) != inactive or hash_of(scene.packed) != hash_of(packed))


def _deep(run):
    """The contacts whose gaps are below zero, each with its depth."""
    allowed = -run.options.initial_tol * run.gaps.lengths(run.length)
    values = run.gaps.at(run.q, run.remembered[: run.count])
    return [f"{run.gaps.names[i]} by {-values[i]:.3g}" for i in run.able if values[i] < allowed[i]]


class Jump(NamedTuple):
    """What velocities jump by at an instant, to find the impulses of constraints from."""

    activated: list  # constraints
    pushes: list  # of `Push`
    qd: Floats  # (n,) before
    load: Floats  # (n,) generalised impulses of the user's


def carry_out(run, change):
    """Change parameters, what is active, and velocities, as bilateral rows ask for: the `Jump`; None where it fails.

    Contacts that the impulses close are hit after it.
    """
    run.change(tuple(change._inactive), change._values)
    activated = list(change._activated.values())
    packed, angles = run.scene.packed, run.remembered[: run.count]
    if activated:
        run.remembered = run.remembered.copy()
        handles = handles_of(packed)
        begin_memory(packed, handles, angles, run.remembered[run.count :], map(handles.own, activated))
    rows = JumpRows(run)
    wrong = [*rows.violated(run.options.initial_tol), *_deep(run)]
    if wrong:
        run.reason = (
            f"At t = {run.t:.9g} s these rows don't hold, m or rad: {listed(wrong, NAMED)}. Let the event find where "
            "they do, or set what they hold (a length, an offset) with them."
        )
        return None
    jump = Jump(activated, change._pushes, run.qd.copy(), rows.load(change._pushes))
    if activated or change._pushes or rows.are_broken(run.qd, run.options.initial_tol):
        run.qd = rows.jumped(run.qd, jump.load)
    return jump


def report(run, jump):
    """List the impulses of the user's and of constraints that have become active, when contacts have been hit, too."""
    found = [(run.t, push.body.name, push.impulse) for push in jump.pushes]
    names = [item.name for item in jump.activated if not getattr(item, "unilateral", False)]
    members = [member for member in run.scene.packed.members if member.constraint.name in names]
    if members:
        rows = JumpRows(run)
        P = rows.impulses(jump.load - rows.M @ (run.qd - jump.qd), [*run.modes.closed, *run.modes.idle])
        for member in members:
            mine = P[member.rows]
            found.append((run.t, member.constraint.name, float(mine[0]) if mine.size == 1 else mine))
    run.phases.impulses += found


class JumpRows:
    """Rows and masses at the present state of a run, dense."""

    def __init__(self, run):
        self.packed, self.gaps, self.q = run.scene.packed, run.gaps, run.q
        system = self.packed.system
        system = system._replace(reals=system.reals.copy())
        system.reals[system.memory] = run.remembered[run.count :]
        self.Phi, self.Phi_q, self.Phi_t, _ = constraint_arrays(system, run.q, run.qd, run.t)
        self.M = mass_matrix(system, run.q)
        off = {id(item) for item in run.without}
        idle = [np.arange(self.Phi.size)[member.rows] for member in self.packed.members if id(member.constraint) in off]
        self.bilateral = np.setdiff1d(np.arange(self.Phi.size), np.concatenate((run.gaps.all_rows(), *idle)))

    def violated(self, tol):
        """The constraints whose rows don't hold, each with its residual."""
        most, found = tol * (1.0 + np.abs(self.q).max()), []
        for member in self.packed.members:
            rows = np.intersect1d(np.arange(self.Phi.size)[member.rows], self.bilateral)
            worst = np.abs(self.Phi[rows]).max(initial=0.0)
            if not worst <= most:
                found.append(f"{member.constraint.name} by {worst:.3g}")
        return found

    def are_broken(self, qd, tol):
        """Whether velocities violate the rows."""
        B, drift = self.Phi_q[self.bilateral], self.Phi_t[self.bilateral]
        return not np.abs(B @ qd + drift).max(initial=0.0) <= tol * (1.0 + np.abs(qd).max())

    def load(self, pushes):
        """Generalised impulses (n,) of impulses on bodies: J on r, 2 G^T (s x A^T J) on p."""
        found = np.zeros(self.q.size)
        for body, impulse, point in pushes:
            at, length = next(
                place for own, place in zip(self.packed.bodies, self.packed.system.bodies.tolist(), strict=True)
                if own.name == body.name
            )  # fmt: skip
            found[at : at + 3] += impulse
            if length == 7:
                p = self.q[at + 3 : at + 7]
                found[at + 3 : at + 7] += 2.0 * transform_g(p).T @ np.cross(point, rotation_matrix(p).T @ impulse)
        return found

    def jumped(self, qd, load):
        """Velocities (n,) with M (v - qd) + B^T P = load, B v + Phi_t = 0."""
        from scipy.linalg import cho_factor, cho_solve, qr, solve_triangular

        D, B, sizes = self._scaled(self.bilateral)
        M = self.M / np.outer(D, D)
        order = np.delete(np.arange(len(B)), dependent(B))
        Q, R = qr(B[order].T)
        own, Z = np.split(Q, [order.size], axis=1)
        rates = -(self.Phi_q[self.bilateral] @ qd + self.Phi_t[self.bilateral])[order]
        change = own @ solve_triangular(R[: order.size], rates / sizes[order], trans="T")
        if Z.size:
            try:
                factor = cho_factor(Z.T @ M @ Z)
            except np.linalg.LinAlgError as error:
                raise SingularConfiguration(NO_INERTIA) from error
            change = change + Z @ cho_solve(factor, Z.T @ (load / D - M @ change))
        return qd + change / D

    def impulses(self, load, closed):
        """Impulses P (m,) of the bilateral rows and those of closed gaps, with Phi_q^T P = load; of least size."""
        rows, P = np.concatenate((self.bilateral, self.gaps.all_rows(closed))), np.zeros(self.Phi.size)
        D, B, sizes = self._scaled(rows)
        P[rows] = np.linalg.lstsq(B.T, load / D, rcond=RANK_TOL)[0] / sizes
        return P

    def _scaled(self, which):
        """D (n,), B (k, n), sizes (k,) with Phi_q = sizes B D of some rows: unit rows in coordinates of unit inertia.

        Alike in all units: a basis mixes coordinates, and inertias of m and rad differ by the square of a length.
        """
        D = np.sqrt(self.M.diagonal())
        for at, length in self.packed.system.bodies:  # which of the four is zero depends on the orientation
            D[at + 3 : at + length] = D[at + 3 : at + length].max(initial=0.0)
        D[D == 0.0] = D.max(initial=0.0) or 1.0
        rows = self.Phi_q[which]
        B = rows / D
        sizes = np.where(row_lengths(rows) > 0.0, np.linalg.norm(B, axis=1), 1.0)
        return D, B / sizes[:, None], sizes


def with_values(scene, values):
    """A scene with other values of some parameters, and parts of its own; the last ones are kept until it changes."""
    if not values:
        return scene
    known, numbers = scene._phases, {name: floats(value).tolist() for name, value in values.items()}
    key = repr(numbers)
    if known is None:
        known = scene._phases = {}
    found = known.get(key)
    if found is None:
        for old in [name for name in known if isinstance(name, str)][: 1 - KEPT]:
            del known[old]
        family, changes = family_of(scene)
        found = packed_anew(family, {**changes, **values})
        if [] not in numbers.values():  # what a function is
            known[key] = found
    return found
