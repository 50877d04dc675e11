"""`scene.linearise`, `scene.equilibrium` and `scene.set_start`: consistent states, as of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting
from ..configuration.tolerances import INITIAL_TOL
from ..elements.bodies import rotation_matrix, transform_g
from ..errors import InconsistentState, InvalidArgument
from ..model.handles import counts, handles_of
from ..observables.state import remembered
from ..runs.task import demand_one_state, state_arrays
from ..validation import finite_vector, number, vector3
from .scene_cache import prepared
from .termination import StageProgress

if TYPE_CHECKING:
    from ..hints import ArrayLike, BodyLike, Equilibrium, Linearisation, Progress, Scene, Solution, State

# `scene.linearise` and `scene.equilibrium`: consistent states, as of a run, handed to the package `analyses`.


@fitting
def linearise(
    scene: Scene,
    state: State | None = None,
    inputs: Sequence[Any] = (),
    outputs: Sequence[Any] = (),
    *,
    progress: Progress | None = None,
) -> Linearisation:
    """Linearise the equations of motion about a state, in named minimal coordinates.

    Parameters
    ----------
    state : State, optional
        Positions and velocities, such as `solution.state`, at its time; default: the start of the bodies at t = 0.
    inputs : sequence of handles or names
        JointTorque, JointForce (the load, N m or N); PointForce, Torque (components in their frame, "push.x" for one);
        Spring (tension of the actuator); joints (torque or force along their coordinate).
    outputs : sequence of handles or names
        Joints (their coordinates), bodies (position of the centroid; "ball.x" for one component), pairs (body, point in
        the body frame), names of coordinates; followed by " rate" in a name, their rates. Default: all coordinates and
        rates.
    progress : bool or callable, optional
        True shows a bar after a second (needs tqdm); a callable receives the fraction done, 0 to 1. What it raises is
        passed on. A Ctrl-C says what has been reached.

    Returns
    -------
    Linearisation
        `.M`, `.C`, `.K`, `.coordinates`, `.eigenvalues()`, `.modes()`, `.state_space()`, `.to_scipy()`.

    Raises
    ------
    InconsistentState
        If the state violates a constraint by more than 1e-9.
    SingularConfiguration
        If Phi_q loses rank at the state, or a direction without inertia is free.
    InvalidForce
        If a force has a jump or a kink at the state, is sampled, or is friction of a joint in motion.
    InvalidArgument
        If the state, an input or an output is not of this scene, or a scene with rows on velocities (rolling, knife
        edges) is neither at rest nor in steady motion.

    Notes
    -----
    Coordinates are those of the joints ("pin.angle", "slide.displacement"), in the order of the joints, as far as they
    are independent; then displacements and rotations of bodies ("ball.x", "top.rotation y"), in axes of the ground.
    Derivatives are exact to rounding: complex steps of laws and primitives, the rest by algebra. In steady motion, axes
    of bodies turn with the motion as a whole, so that all coefficients are constant (Likins 1967; Meirovitch 1970).
    Functions of time have their values at the time of the state. The cost is O(N) for chains and trees, and that of a
    few solutions for each of k coordinates. In scenes of more than 400 Euler parameters and positions rotations of
    bodies come before displacements.

    Examples
    --------
    A pendulum of 1 m:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -9.0))
    >>> rod = scene.add_body(**ts.shapes.rod(1.0, axis="z", mass=3.0), position=(0, 0, -0.5), name="rod")
    >>> pin = scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    >>> linear = scene.linearise(inputs=[pin])
    >>> linear
    <Linearisation at rest: pin.angle>
    >>> print(linear.M.round(6), linear.K.round(6), linear.eigenvalues().round(4))
    [[1.]] [[13.5]] [0.+3.6742j 0.-3.6742j]
    """
    from ..analyses.linearise import linearise as find  # imported here: a run needs none of it

    for given, what in ((inputs, "inputs"), (outputs, "outputs")):
        if isinstance(given, str) or not isinstance(given, Sequence):
            raise InvalidArgument(f"{what} must be a sequence of handles or names, such as [motor], got {given!r}.")
    with StageProgress(progress, "linearise") as report:
        report(0.0, "the start is checked")
        kept = prepared(scene)
        q, qd = scene._initial() if state is None else state_arrays(state, kept.n)
        t = 0.0 if state is None else number(getattr(state, "t", 0.0))
        memory = remembered(state, kept, t, q)
        q, qd = kept.start(scene, (q, qd), t, INITIAL_TOL, memory, True)
        memory = memory[kept.handles.count :]
        return find(scene, memory, (t, q.copy(), qd.copy()), tuple(inputs), tuple(outputs), report)


@fitting
def equilibrium(
    scene: Scene,
    guess: State | ArrayLike | None = None,
    t: float = 0.0,
    spin: ArrayLike | None = None,
    about: ArrayLike = (0.0, 0.0, 0.0),
    rotors: Mapping[BodyLike, ArrayLike] | None = None,
    *,
    progress: Progress | None = None,
) -> Equilibrium:
    """Find a static equilibrium: from the scene's pose, or a guess, down to a minimum of the potential energy.

    With a spin: a relative equilibrium, a configuration that turns steadily as a whole.

    Parameters
    ----------
    guess : State or array_like (n,), optional
        Positions to start from; default: those of the bodies. They are moved to the nearest consistent ones first.
    t : float, s
        Time at which loads and constraints are taken.
    spin : array_like (3,), rad/s, optional
        Angular velocity, ground frame, at which everything turns.
    about : array_like (3,), m
        A point of the axis of the spin.
    rotors : dict, optional
        Bodies that spin about their own axis of symmetry besides, relative to the turning axes: rad/s about that axis,
        or an angular velocity (3,) in the body frame. A number counts about the direction of the axis whose largest
        component in the body frame is positive.
    progress : bool or callable, optional
        True shows a bar after a second (needs tqdm); a callable receives the fraction done, 0 to 1. What it raises is
        passed on. A Ctrl-C says what has been reached.

    Returns
    -------
    Equilibrium
        `.state`, `.stable`, `.smallest_stiffness`, `.moved`, `.reaction(joint)` and more. The scene is not changed.

    Raises
    ------
    NoEquilibrium
        If none is found: something falls, or a load drives it on.
    InconsistentState
        If the constraints can't be satisfied near the start, move at time t, or don't admit the spin.
    SingularConfiguration
        If Phi_q loses rank at the start.
    InvalidForce
        If a load is sampled, or the equilibrium is on a jump of a force.
    InvalidArgument
        If the guess is not n finite numbers or a state, or a scene with exact friction is given a spin.

    Notes
    -----
    Newton steps with the exact stiffness, geometric stiffness of reactions included, where it is positive on the
    motions that the constraints admit; elsewhere steps that lead down all the same. They lower the potential energy on
    the constraint manifold down to rounding, and their number hardly grows with that of bodies. Saddles are left along
    their direction of most negative stiffness. Work along a step takes the place of energy, so loads need no potential.
    Redundant rows are allowed. Dampers and smooth friction exert nothing at rest. With a spin, Newton steps lead to the
    nearest relative equilibrium, a top's steady precession for one; where it is unstable, gyroscopic terms included, it
    is left along the mode that grows, down to a minimum of the amended potential V - Omega . J Omega / 2.

    Exact friction, of joints and of contacts: where it holds all that it acts on at the start, within its static
    bounds, it does so in the equilibrium, too. A scene at rest is reported as it stands, `moved` = 0, and what is free
    beside comes to rest. Elsewhere the equilibrium is that without friction, which is one with friction as well.
    Neither is for a spin.

    Examples
    --------
    A pendulum that stands upright falls over:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -9.0))
    >>> rod = scene.add_body(**ts.shapes.rod(1.0, axis="z", mass=3.0), position=(0, 0, 0.5), name="rod")
    >>> pin = scene.add(ts.constraints.Revolute.at(scene.ground, rod, point=(0, 0, 0), axis=(0, 1, 0), name="pin"))
    >>> found = scene.equilibrium()
    >>> found
    <Equilibrium: stable, smallest stiffness 13.5 1/s^2>
    >>> print(found.state.position(rod).round(6) + 0.0, found.reaction(pin)[0].round(6) + 0.0)
    [ 0.   0.  -0.5] [ 0.  0. 27.]
    """
    with StageProgress(progress, "equilibrium") as report:
        report(0.0, "the start is checked")
        return descend(scene, guess, t, spin, about, rotors, report)


def descend(scene, guess, t, spin, about, rotors, report, watch=None):
    """The `Equilibrium`; watch is that of the `Descent`."""
    from ..analyses.equilibrium import (  # imported here: a run needs none of it
        demand_admitted,
        find_equilibrium,
        find_relative,
    )
    from ..configuration.continuation import Metric, nearest

    kept = prepared(scene)
    field = _field(kept.packed, spin, about, rotors)
    if guess is None:
        given = scene._initial()[0]
    else:
        given = _positions(kept.packed, guess, kept.n)
    if not np.isfinite(number(t)):
        raise InvalidArgument(f"t must be a finite time in s, got {t!r}.")
    metric = Metric(kept.packed, None, float(t))
    q, Phi = given, metric.arrays(given)[0]
    if not np.abs(Phi).max(initial=0.0) <= INITIAL_TOL * (1.0 + np.abs(q).max()):
        found = nearest(metric, given, INITIAL_TOL)
        if not found.met:
            raise InconsistentState(
                "equilibrium: no consistent positions were found near the start. Call scene.assemble(), which names "
                "the constraints in conflict, or pass another guess."
            )
        q = found.q
    _, Phi_q, Phi_t = metric.arrays(q)
    qd = np.zeros(kept.n) if field is None else field.levels(q)[0]
    if field is None:
        _demand_rest(scene, Phi_t, t)
    else:
        demand_admitted(scene, Phi_q @ qd + Phi_t, qd)
    state = guess if hasattr(guess, "memory") else None
    memory = remembered(state, kept, float(t), q)
    q, _ = kept.start(scene, (q, qd), float(t), INITIAL_TOL, memory, True)
    arguments = kept.packed, kept.handles, memory, float(t), q.copy(), given
    if field is None:
        return find_equilibrium(*arguments, report, watch)
    return find_relative(*arguments, field, report)


def _positions(packed, guess, n):
    """The positions (n,) of a guess."""
    if isinstance(guess, Mapping):
        raise InvalidArgument(
            f"guess must be positions q ({n},) or a State, got {guess!r}. scene.set(joint, ...) places joints, and "
            "the pose of the scene is the guess then."
        )
    demand_one_state(guess, f"guess must be one State, or positions q ({n},)")
    q = finite_vector(getattr(guess, "q", guess), n, "guess (q, or a State)")
    for body, (at, dimension) in zip(packed.bodies, packed.system.bodies.tolist(), strict=True):
        if dimension == 7 and not q[at + 3 : at + 7].any():
            raise InvalidArgument(
                f"guess: the Euler parameters of {body.name} (q[{at + 3}:{at + 7}]) are zero, which is no orientation; "
                "(1, 0, 0, 0) is that of the ground."
            )
    return q


def _field(packed, spin, about, rotors):
    """The `SteadyField` of a spin; None without one."""
    if spin is None and rotors is None:
        if np.any(vector3(about, "equilibrium: about (m)", InvalidArgument)):
            raise InvalidArgument(f"equilibrium: about={about!r} is a point of the axis of a spin; give spin=, too.")
        return None
    from ..analyses.steady import SteadyField, rotors_of

    spin = vector3(np.zeros(3) if spin is None else spin, "equilibrium: spin (rad/s)", InvalidArgument)
    about = vector3(about, "equilibrium: about (m)", InvalidArgument)
    rotors = rotors_of(packed, rotors)
    if not any(map(np.any, (spin, *rotors.values()))):
        raise InvalidArgument(
            "equilibrium: spin and rotors are zero, so nothing turns; leave them out for an equilibrium at rest."
        )
    return SteadyField(packed, spin, about, rotors)


def _demand_rest(scene, Phi_t, t):
    """Refuse constraints that move at t, by name."""
    if np.any(Phi_t):
        row = scene.row_names()[int(np.abs(Phi_t).argmax())]
        raise InconsistentState(
            f"equilibrium: {row} moves at t = {float(t):g} s (Phi_t = {np.abs(Phi_t).max():.3g}), so the scene can't "
            "be at rest. Choose a time at which its motion rests, hold it with a constant value, or give the spin= "
            "with which everything turns."
        )


# `scene.set_start`: a state as the start of a scene, or the velocity of the scene as a whole.


@fitting
def set_start(
    scene: Scene,
    state: State | Equilibrium | Solution | None = None,
    *,
    velocity: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
) -> None:
    """Set the positions and velocities of all bodies at the start: those of a state, or of a rigid motion.

    Parameters
    ----------
    state : State, Equilibrium or Solution, optional
        Positions and velocities, and the turns that the joints have made: of `solution.state`, `solution.at(t)`, an
        equilibrium, or the end of a run. By default the positions remain.
    velocity : array_like (3,), m/s, optional
        Of the centre of mass of the scene, ground frame. With it, or with angular_velocity, all bodies move as one
        rigid body, and velocities of the state are replaced; the one that isn't given is zero.
    angular_velocity : array_like (3,), rad/s, optional
        Of the scene about its centre of mass, ground frame.

    Raises
    ------
    InvalidArgument
        If nothing is given, the state is not of this scene, or a number is not finite.
    InconsistentState
        If a constraint doesn't admit the positions, at the time of the state, or the velocities; a hinge on the ground,
        for instance, the velocity of the whole. The scene is unchanged.

    Notes
    -----
    Constraints are satisfied to rounding, by the smallest correction, of residuals up to 1e-9. Motions of time are
    those at the time of the state, or t = 0: a run begins there. What forces remember otherwise than by turns, such as
    the load since the last sampling time, is not part of a start; `simulate(..., state=state)` goes on with it.

    Examples
    --------
    A dumbbell hangs at rest, is let go, and is thrown:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> one = scene.add_point_mass(mass=1.0, position=(-1, 0, 0), name="one")
    >>> two = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="two")
    >>> rod = scene.add(ts.constraints.Distance(one, two, name="rod"))
    >>> scene.set_start(velocity=(3, 0, 5), angular_velocity=(0, 2, 0))
    >>> print(one.velocity, two.velocity)
    [3. 0. 7.] [3. 0. 3.]
    >>> scene.set_start(ts.simulate(scene, (0, 1)))
    >>> print(((one.position + two.position) / 2).round(6) + 0.0)
    [3. 0. 0.]
    """
    if state is None and velocity is None and angular_velocity is None:
        raise InvalidArgument("set_start: nothing is given; give a state, velocity= or angular_velocity=.")
    kept = prepared(scene)
    state = getattr(state, "state", state)
    q, qd = scene._initial() if state is None else state_arrays(state, kept.n)
    t = 0.0 if state is None else number(getattr(state, "t", 0.0))
    memory = remembered(state, kept, t, q)
    if velocity is not None or angular_velocity is not None:
        given = {"velocity (m/s)": velocity, "angular_velocity (rad/s)": angular_velocity}
        V, Omega = (
            np.zeros(3) if value is None else vector3(value, f"set_start: {what}", InvalidArgument)
            for what, value in given.items()
        )
        qd = _rigid(kept.packed.system, q, V, Omega)
    q, qd = kept.start(scene, (q, qd), t, INITIAL_TOL, memory, True)
    scene.place(q.copy(), qd.copy())
    if state is None:
        return
    scene.touch()  # makes the scene's own joints of a scene with other parameters
    for row in handles_of(scene.packed).rows:
        if row.angles and not counts(row.item):
            row.item.__dict__["angle_near"] = tuple(memory[row.first : row.first + len(row.angles)].tolist())
    scene.touch()


def _rigid(system, q, V, Omega):
    """Velocities qd (n,) of all bodies as of one: V of the centre of mass, and Omega about it, ground frame."""
    qd, at = np.zeros_like(q), system.bodies[:, 0]
    r = q[at[:, None] + np.arange(3)]
    centre = system.mass @ r / system.mass.sum()
    for first, dimension in system.bodies.tolist():
        qd[first : first + 3] = V + np.cross(Omega, q[first : first + 3] - centre)
        if dimension == 7:
            p = q[first + 3 : first + 7]
            qd[first + 3 : first + 7] = 0.5 * transform_g(p).T @ (rotation_matrix(p).T @ Omega)
    return qd
