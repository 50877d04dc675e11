"""`scene.linearise`: a consistent state, as a run would start from it, handed to the package `statics`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..calls import fitting
from ..errors import InvalidArgument
from ..observables.state import remembered
from ..runs.arguments import state_arrays
from ..validation import number
from .scene_cache import prepared

if TYPE_CHECKING:
    from ..hints import Linearisation, Scene, State

INITIAL_TOL = 1e-9  # of residuals of a state, as in `simulate`


@fitting
def linearise(
    scene: Scene, state: State | None = None, inputs: Sequence[Any] = (), outputs: Sequence[Any] = ()
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
        If the state, an input or an output is not of this scene.

    Notes
    -----
    Coordinates are those of the joints ("pin.angle", "slide.displacement"), in the order of the joints, as far as they
    are independent; then displacements and rotations of bodies ("ball.x", "top.rotation y"), in axes of the ground.
    Derivatives are exact to rounding: complex steps of laws and primitives, the rest by algebra. In steady motion, axes
    of bodies turn with the motion as a whole, so that all coefficients are constant (Likins 1967; Meirovitch 1970).
    Functions of time have their values at the time of the state. The cost is O(N) for chains and trees, and that of k
    solutions for k coordinates.

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
    from ..statics.linearise import linearise as find  # imported here: a run needs none of it

    for given, what in ((inputs, "inputs"), (outputs, "outputs")):
        if isinstance(given, str) or not isinstance(given, (Sequence, list, tuple)):
            raise InvalidArgument(f"{what} must be a sequence of handles or names, such as [motor], got {given!r}.")
    kept = prepared(scene)
    q, qd = scene._initial() if state is None else state_arrays(state, kept.n)
    t = 0.0 if state is None else number(getattr(state, "t", 0.0))
    memory = remembered(state, kept, t, q)
    q, qd = kept.start(scene, (q, qd), t, INITIAL_TOL, memory, True)
    return find(scene, memory[kept.handles.count :], (t, q.copy(), qd.copy()), tuple(inputs), tuple(outputs))
