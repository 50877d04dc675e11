"""`compare`: a scene in another engine, against tsdyn at 1e-12."""

from __future__ import annotations

from time import perf_counter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..calls import fitting
from ..errors import InvalidArgument
from ..observables import diagnostics, power
from ..runs.arguments import interval
from ..simulation.simulate import simulate
from ..validation import positive, whole
from . import engines
from .result import Comparison, Levels

if TYPE_CHECKING:
    from ..hints import Scene

TOLERANCE = 1e-12  # of the reference
SHORT = 1e-6  # of the span: a run that loads kernels


@fitting
def compare(
    scene: Scene,
    t_span: tuple[float, float] = (0.0, 10.0),
    *,
    with_: str,
    step: float = 1e-3,
    method: str | None = None,
    outputs: int = 200,
    options: Any = None,
) -> Comparison:
    """Run a scene in another engine, at the step that you use there, and tell how wrong the run is.

    Parameters
    ----------
    scene : Scene
    t_span : (float, float), s
    with_ : {"mujoco", "exudyn"}
        The engine, which must be installed.
    step : float, s
        Of the engine.
    method : str, optional
        Of the engine, by default its own default: "euler", "rk4", "implicit", "implicitfast" of MuJoCo;
        "GeneralizedAlpha", "TrapezoidalIndex2", ... of Exudyn.
    outputs : int
        Times at which the runs are compared, about.
    options : dict, optional
        Of MuJoCo: solref and solimp of equality constraints, which close loops there.

    Returns
    -------
    Comparison
        Error against time, constraint violation, energy and cost; print it, or `.plot()`.

    Raises
    ------
    MissingDependency
        If the engine is not installed.
    InvalidArgument
        If the engine can't have the scene: names each constraint and force.
    StepFailure
        If one of the runs doesn't reach its end.

    Notes
    -----
    The reference is tsdyn's default method at rtol = atol = 1e-12. In MuJoCo, joints that form a tree are joints of
    MuJoCo, and those that close loops are equality constraints. In Exudyn, all are constraints.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> bar = scene.add_body(**ts.shapes.rod(1.0, axis="x", mass=3.0), position=(0.5, 0, 0))
    >>> hinge = scene.add(ts.constraints.Revolute.at(scene.ground, bar, point=(0, 0, 0), axis=(0, 1, 0)))
    >>> try:
    ...     ts.compare(scene, with_="mojoco")
    ... except ts.InvalidArgument as error:
    ...     print(error)
    compare: with_='mojoco' is no engine that is known; did you mean mujoco? There are mujoco, exudyn.
    """
    start, end = interval(t_span)
    step, outputs = positive(step, "compare: step (s)"), whole(outputs, "compare: outputs") or 200
    if options is not None and not isinstance(options, dict):
        raise InvalidArgument(f"compare: options must be a dictionary, got {options!r}.")
    _ = scene.packed  # refuses a scene without bodies
    found = engines.run(scene, with_, end - start, min(step, end - start), outputs, method, options or {})
    finite = np.isfinite(found.q).all(axis=1) & np.isfinite(found.qd).all(axis=1)
    kept = len(finite) if finite.all() else int(finite.argmin())
    t, q, qd = start + found.t[:kept], found.q[:kept], found.qd[:kept]
    tight = {"rtol": TOLERANCE, "atol": TOLERANCE, "constraint_tol": 1e-13}
    simulate(scene, (start, start + SHORT * (end - start)), **tight)  # loads kernels
    begun = perf_counter()
    ours = simulate(scene, (start, end), t_eval=np.minimum(t, end), **tight).raise_if_failed()
    seconds = perf_counter() - begun
    return Comparison(
        engine=found.name, method=found.method, step=step, t=t, names=tuple(body.name for body in scene.bodies),
        position_error=_apart(scene, q, ours.q), rotation_error=_turned(scene, q, ours.q),
        theirs=_levels(ours, t, q, qd), ours=_levels(ours, t, ours.q, ours.qd), seconds=found.seconds,
        reference_seconds=seconds,
        reached=bool(kept == len(finite)),
    )  # fmt: skip


def _columns(scene):
    """Where the coordinates of each body begin."""
    return scene.system.bodies[:, 0].tolist()


def _apart(scene, q, reference):
    """Distances of the centroids (k, b), m."""
    return np.stack(
        [np.linalg.norm(q[:, at : at + 3] - reference[:, at : at + 3], axis=1) for at in _columns(scene)], axis=1
    )


def _turned(scene, q, reference):
    """Angles between the orientations (k, b), rad; zero of point masses."""
    found = np.zeros((len(q), len(scene.bodies)))
    for i, (body, at) in enumerate(zip(scene.bodies, _columns(scene), strict=True)):
        if body.dimension == 7:
            p, other = q[:, at + 3 : at + 7], reference[:, at + 3 : at + 7]
            near = np.where((p * other).sum(axis=1, keepdims=True) < 0.0, -other, other)
            found[:, i] = 4.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(p - near, axis=1), 1.0))
    return found


def _levels(ours, t, q, qd):
    """Constraint violation and energy of a trajectory; angles count the turns of ours."""
    packed, memory = ours.packed, ours._memory
    error = diagnostics.constraint_error(packed, t, q, qd, np.zeros_like(q), memory)
    forces = power.force_powers(SimpleNamespace(t=t, q=q, qd=qd, _memory=memory, packed=packed))
    energy = diagnostics.kinetic_energy(packed.system, q, qd) + diagnostics.potential_energy(packed.system, q)
    return Levels(error.position, error.velocity, energy + forces.potential)
