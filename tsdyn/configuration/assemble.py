"""`scene.assemble`: nearest consistent positions, then nearest consistent velocities."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..calls import fitting
from ..elements.names import named
from ..errors import InconsistentState, InvalidArgument, InvalidBody
from ..jit.interrupts import CollectionsDeferred
from ..maths.row_rank import row_lengths
from ..validation import number, one_of, positive, sequence
from .continuation import Found, Kept, approach_sketch, close, nearest, relax, stuck
from .infeasible_subset import refuse
from .kinetic_metric import Metric, least_energy, least_step, rotation_vectors
from .loop_folds import Folds
from .mirrored_branches import demand_aligned
from .motor_starts import approach, has_motors
from .start_violations import demand_finite, refuse_vanished
from .tolerances import ASSEMBLED, LEAST_VELOCITY_TOL, ROUNDING, STAGES, STIFFER, UNFOLDED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..hints import PointMass, Scene


@dataclass(frozen=True)
class AssemblyReport:
    """Result of `scene.assemble`.

    Attributes
    ----------
    moved : float
        Largest change of a coordinate: m for positions, 1 for Euler parameters.
    residual : float
        Largest |Phi| left.
    velocity_changed : float
        Largest change of a velocity coordinate.
    velocity_residual : float
        Largest |Phi_q qd + Phi_t| left.
    iterations : int
    folded : tuple of str
        Joints of closed loops whose links are folded to the other side than in the sketch, by 0.1 rad or more: the
        sketch was ambiguous (see `folds` of `assemble`), or `folds="free"` was given.
    """

    moved: float
    residual: float
    velocity_changed: float
    velocity_residual: float
    iterations: int
    folded: tuple = ()


@fitting
@CollectionsDeferred()
def assemble(
    scene: Scene,
    tol: float = ASSEMBLED,
    fixed: Sequence[PointMass | str] = (),
    t: float = 0.0,
    folds: Folds = "keep",
    free: Sequence[PointMass | str] | None = None,
) -> AssemblyReport:
    """Move the bodies to the nearest consistent positions, then to the nearest consistent velocities.

    Parameters
    ----------
    tol : float
        Largest |Phi| accepted at the end, relative to 1 + max |q|.
    fixed : sequence of Body, or names
        Bodies whose pose (not velocity) must stay as it is.
    t : float, s
        Time at which rheonomic constraints are satisfied.
    folds : "keep" or "free"
        "keep": links of closed loops fold as in the sketch wherever the sketch is unambiguous, that is by 0.2 rad or
        more, by the directions of the links and by the positions of their joints. "free": the nearest configuration
        on any branch. The report lists links that fold over.
    free : sequence of Body, or names; optional
        The bodies that may move, in place of `fixed`: the pose of all others stays as it is.

    Returns
    -------
    AssemblyReport
        `.moved`, `.residual` and more; the bodies hold the new values.

    Raises
    ------
    InconsistentState
        If the constraints can't be satisfied (the error names a smallest set in conflict, `.constraints`), or only by
        a mirrored joint or on another branch than the sketch's. The bodies are unchanged.
    SingularConfiguration
        If a row of Phi_q vanishes at the configuration found.

    Notes
    -----
    A joint that stands far from the angle that its motor prescribes is taken there first: in a tree, the bodies beyond
    it move as one rigid body; in a loop it is driven in small steps, on the present branch.

    Springs hold the bodies at their poses in the sketch, in the metric of kinetic energy; the constraints are springs
    whose stiffness increases until they hold. Gauss-Newton steps follow. Redundant rows are allowed. For the positions
    a mass counts as 1e-8 of the largest at least, a moment of inertia also as 1e-6 of the body's mean. The velocity
    correction has the least kinetic energy, with masses as they are; above 200 coordinates with those of the positions.

    Examples
    --------
    A ball is moved to the end of its rod:

    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> ball = scene.add_point_mass(mass=1.0, position=(1.2, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(ball, scene.ground, length=1.0))
    >>> print(f"moved by {scene.assemble().moved:.2f} m to {ball.position.round(6) + 0.0}")
    moved by 0.20 m to [1. 0. 0.]
    """
    tol = positive(tol, "tol")
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"t must be a finite time in s, got {t!r}.")
    one_of(folds, ("keep", "free"), "folds")
    numbers, t, driven = _fixed(scene, fixed, free), float(t), has_motors(scene)
    sketch = scene.start

    def assembled():
        return assembled_nearby(scene, numbers, t, tol, folds)

    try:
        if driven:
            approach(scene, t, numbers, assembled)
        report = assembled()
    except BaseException:
        if not np.array_equal(scene.start[0], sketch[0]):
            scene.place(*sketch)
        raise
    return replace(report, moved=float(np.abs(scene.start[0] - sketch[0]).max()))


def assembled_nearby(scene, fixed, t, tol=ASSEMBLED, folds="free"):
    """Assemble without a way to the angles of motors; return the `AssemblyReport`."""
    packed, (sketch, qd) = scene.packed, scene.start
    metric = whole = Metric(packed, None, t)
    if fixed:
        metric = Metric(packed, _held(packed, fixed), t)
    demand_finite(scene, *metric.arrays(sketch))
    found = nearest(metric, sketch, tol)
    if not found.met:
        _demand_direction(scene, metric, found)
        refuse(scene, metric, sketch, found, tol, [scene.bodies[i] for i in fixed])
    links = Folds(packed) if _largest_turn(metric, sketch, found.q) > UNFOLDED else None
    if links is not None and folds == "keep":
        found = _unfolded(metric, sketch, found, links, tol)
    q = found.q
    Phi, Phi_q, Phi_t = whole.arrays(q)
    A = whole.reduced(q, Phi_q[whole.own])
    _demand_regular(scene, whole, A)
    demand_aligned(packed, q, t)
    given, qd = _velocities(whole, q, (sketch, qd), A, Phi_q, Phi_t[whole.own])
    residual = Phi_q @ qd + Phi_t
    _demand_compatible(scene, residual, max(tol, LEAST_VELOCITY_TOL) * (1.0 + np.abs(qd).max()))
    over = () if links is None else links.turned(metric, q, links.shown(metric, sketch))
    scene.place(q, qd)
    return AssemblyReport(
        moved=float(np.abs(q - sketch).max()),
        residual=float(np.abs(Phi).max(initial=0.0)),
        velocity_changed=float(np.abs(qd - given).max()),
        velocity_residual=float(np.abs(residual).max(initial=0.0)),
        iterations=found.iterations,
        folded=tuple(dict.fromkeys(links.folds[k].title for k in over)),
    )


def _fixed(scene, fixed, free):
    """Return the numbers of the bodies that are to be fixed."""
    if free is None:
        return _numbers(scene, fixed, "fixed")
    if len(sequence(fixed, "fixed must be a sequence of bodies", InvalidBody)):
        raise InvalidArgument("fixed and free say the same twice: give the bodies that stay, or those that may move.")
    moving = _numbers(scene, free, "free")
    return [i for i in range(len(scene.packed.bodies)) if i not in moving]


def _numbers(scene, given, word):
    """Return the numbers of bodies that are given by handle or name; names of a scene need no handles."""
    given, found = sequence(given, f"{word} must be a sequence of bodies, such as (body,)", InvalidBody), []
    for it in given:
        known = scene.packed.bodies if isinstance(it, str) else scene.bodies
        body = named(known, it, f"body to be {word}", InvalidBody) if isinstance(it, str) else it
        if not any(body is other for other in known):
            raise InvalidBody(f"{word}: {body!r} is not a body of this scene.")
        found.append(body.index)
    return found


def _held(packed, fixed):
    """Return True for each coordinate that is held, (n,)."""
    places = packed.system.bodies
    held = np.zeros(int(places[:, 1].sum()), bool)
    for at, length in places[fixed].tolist():
        held[at : at + length] = True
    return held


def _largest_turn(metric, sketch, q):
    """Return the largest rotation of a body between two configurations, rad."""
    return np.linalg.norm(rotation_vectors(sketch[metric.p], q[metric.p]), axis=1).max(initial=0.0)


def _unfolded(metric, sketch, found, links, tol):
    """Return the configuration found, or a nearby one whose links fold as in the sketch."""
    drawn = links.drawn(metric, sketch)
    turned = links.turned(metric, found.q, drawn)
    kept, total, first = set(), found.iterations, turned
    for softness in STIFFER:
        if not turned.size:
            return found
        kept |= set(turned.tolist())
        pairs = np.array(list(dict.fromkeys(tuple(sorted(links.folds[k].bodies)) for k in sorted(kept))))
        q, steps = relax(metric, sketch, sketch, kept=Kept(pairs, softness), stages=STAGES)
        q, Phi, more = close(metric, q)
        total += steps + more
        met = bool(np.abs(Phi).max(initial=0.0) <= tol * (1.0 + np.abs(q).max()))
        turned = links.turned(metric, q, drawn)
        if not met:
            turned = first
        elif not turned.size:
            freed, Phi_freed, more = approach_sketch(metric, sketch, q)
            total += more
            fits = np.abs(Phi_freed).max() <= tol * (1.0 + np.abs(freed).max())
            if fits and not links.turned(metric, freed, drawn).size:
                q, Phi = freed, Phi_freed
            return Found(q, Phi, total, True)
    stories = [
        f"  {links.folds[k].title}: {np.degrees(links.angle(metric, sketch, k)):.0f} degrees from straight in the "
        f"sketch, {np.degrees(links.angle(metric, found.q, k)):.0f} when assembled"
        for k in first[:8]
    ]
    raise InconsistentState(
        "the configurations found are on another branch than the sketch: links are folded to the other side:\n"
        + "\n".join(stories)
        + '\nDraw these links further from straight, or on the other side; or pass folds="free" to accept the '
        "nearest configuration on any branch."
    )


def _velocities(metric, q, sketch, A, Phi_q, Phi_t):
    """Return qd of the sketch (q, qd), its angular velocities at the orientations q, and the nearest consistent qd."""
    qd = sketch[1]
    x = metric.speeds(qd[metric.r], metric.spins(*sketch))
    given = qd.copy()
    given[metric.p] = metric.rates(q, x)[metric.p]
    exact = metric.is_bounded and not metric.sparse
    if exact:
        metric = Metric(metric.packed, None, metric.t, lengths=True)
        A, x = metric.reduced(q, Phi_q[metric.own]), metric.speeds(qd[metric.r], metric.spins(*sketch))
    fitted = given
    for _ in range(3):
        residual = A @ x + Phi_t
        if np.abs(residual).max(initial=0.0) <= ROUNDING * (1.0 + np.abs(fitted).max()):
            break
        x = least_energy(metric, q, A, x, Phi_t) if exact else x + least_step(A, residual)
        fitted = metric.rates(q, x)
    return given, fitted


def _demand_direction(scene, metric, found):
    """Refuse a violated constraint whose derivative vanishes: the correction is undetermined."""
    still = stuck(metric, found.q, found.Phi)
    if still.size and metric.columns.size == metric.size:
        name = scene.row_names()[metric.own[still[0]]]
        raise InconsistentState(
            f"{name}: Phi = {found.Phi[still[0]]:.3g} and its derivative vanishes, so the direction of a correction is "
            "undetermined. Displace its bodies slightly towards the intended configuration."
        )


def _demand_regular(scene, metric, A):
    """Refuse zero rows."""
    zero = np.flatnonzero(row_lengths(A) == 0.0)
    if zero.size:
        refuse_vanished(scene.row_names()[metric.own[zero[0]]])


def _demand_compatible(scene, residual, tol):
    """Refuse redundant rows with different rates, by name."""
    bad = np.flatnonzero(~(np.abs(residual) <= tol))
    if bad.size:
        names = scene.row_names()
        rows = ", ".join(f"{names[i]} ({residual[i]:.3g})" for i in sorted(bad, key=lambda i: -abs(residual[i]))[:8])
        raise InconsistentState(
            f"no velocities satisfy all constraints in the configuration found; residuals of Phi_q qd + Phi_t: {rows}. "
            "Redundant driven rows must have equal rates: correct their motions, or remove one."
        )
