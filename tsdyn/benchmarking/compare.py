"""`compare`: a scene in another engine, against tsdyn at 1e-12."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from time import perf_counter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..calls import fitting
from ..drawing import BLUE, VERMILION, Tabulated, new_figure
from ..elements.bodies import transform_g
from ..errors import InvalidArgument, MissingDependency, StepFailure
from ..observables import diagnostics, power
from ..runs.arguments import interval
from ..simulation.simulate import simulate
from ..validation import nearest, positive, whole

if TYPE_CHECKING:
    from ..hints import Floats, Scene


# `Comparison`: how far the run of another engine is from the reference.

LEAST = 1e-17  # drawn on a logarithmic axis in place of zero


class Levels(NamedTuple):
    """What a trajectory does to constraints and energy, (k,) each."""

    position: Floats  # largest |Phi|
    velocity: Floats  # largest |Phi_q qd + Phi_t|
    energy: Floats  # J


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Tabulated):
    """The result of `ts.compare`.

    Attributes
    ----------
    engine, method : str
    step : float, s
    t : ndarray (k,), s
    names : tuple of str
        Of the bodies.
    position_error : ndarray (k, b), m
        Distance of each centroid from where tsdyn has it.
    rotation_error : ndarray (k, b), rad
    theirs, ours : Levels
        Of the engine, and of tsdyn: `position`, `velocity` (largest constraint residuals), `energy` (J), (k,) each.
    seconds, reference_seconds : float, s
        Of the steps of the engine, and of tsdyn's run at 1e-12.
    reached : bool
        Whether the engine's run remained finite up to its end.
    """

    engine: str
    method: str
    step: float
    t: Floats
    names: tuple[str, ...]
    position_error: Floats
    rotation_error: Floats
    theirs: Levels
    ours: Levels
    seconds: float
    reference_seconds: float
    reached: bool
    _left = (0, 1, 2)

    @property
    def error(self) -> Floats:
        """The largest distance of a centroid from where it should be (k,), m."""
        return self.position_error.max(axis=1)

    def rows(self) -> list[tuple[str, str, str]]:
        """What is compared, of the engine and of tsdyn."""
        drift = [float(np.abs(one.energy - one.energy[0]).max()) for one in (self.theirs, self.ours)]
        levels = [
            [float(getattr(one, name).max()) for one in (self.theirs, self.ours)] for name in ("position", "velocity")
        ]
        worst = self.names[int(self.position_error.max(axis=0).argmax())]
        return [
            ("largest error of a position (m)", f"{self.error.max():.2e} ({worst})", ""),
            ("at the end (m)", f"{self.error[-1]:.2e}", ""),
            ("largest error of a rotation (rad)", f"{self.rotation_error.max():.2e}", ""),
            ("constraint violation, position", *(f"{x:.1e}" for x in levels[0])),
            ("constraint violation, velocity", *(f"{x:.1e}" for x in levels[1])),
            ("largest change of energy (J)", *(f"{x:.2e}" for x in drift)),
            ("time of the run (s)", f"{self.seconds:.3g}", f"{self.reference_seconds:.3g}"),
        ]

    def _shown(self):
        heads = "", f"{self.engine}, {self.method}, step {self.step:g} s", "tsdyn at 1e-12"
        said = [] if self.reached else [f"The engine's run is not finite after t = {self.t[-1]:g} s."]
        return [], [heads, *self.rows()], said

    def __repr__(self) -> str:
        return f"<Comparison with {self.engine}: error {self.error.max():.2e} m after {self.t[-1] - self.t[0]:g} s>"

    def figure(self) -> Any:
        """The matplotlib Figure: error, constraint violation and energy against time, and cost."""
        with new_figure(9.0, 6.0) as figure:
            (error, violation), (energy, cost) = figure.subplots(2, 2)
            error.semilogy(self.t, np.maximum(self.error, LEAST), color=VERMILION, label="position (m)")
            angle = np.maximum(self.rotation_error.max(axis=1), LEAST)
            error.semilogy(self.t, angle, color=VERMILION, linestyle="--", label="rotation (rad)")
            error.set(xlabel="time (s)", ylabel="largest error", title=f"{self.engine}, {self.method}, {self.step:g} s")
            for one, colour, name in ((self.theirs, VERMILION, self.engine), (self.ours, BLUE, "tsdyn")):
                violation.semilogy(self.t, np.maximum(one.position, LEAST), color=colour, label=name)
                violation.semilogy(self.t, np.maximum(one.velocity, LEAST), color=colour, linestyle="--")
                change = np.maximum(np.abs(one.energy - one.energy[0]), LEAST)
                energy.semilogy(self.t, change, color=colour, label=name)
            violation.set(
                xlabel="time (s)", ylabel="position (m), velocity (m/s, dashed)", title="constraint violation"
            )
            energy.set(xlabel="time (s)", ylabel="change (J)", title="energy")
            cost.barh([self.engine, "tsdyn, 1e-12"], [self.seconds, self.reference_seconds], color=[VERMILION, BLUE])
            cost.set(xlabel="time of the run (s)", title="cost")
            for axes in (error, violation, energy):
                axes.legend(fontsize=8)
        return figure


# The other engines: how a scene gets there, and what of it can't.


class EngineRun(NamedTuple):
    """A run of another engine, in the coordinates of the scene."""

    name: str  # with version
    method: str
    t: Floats
    q: Floats
    qd: Floats
    seconds: float


def run(
    scene: Scene, engine: str, end: float, step: float, outputs: int, method: str | None, options: Any
) -> EngineRun:
    """The run of a scene by an engine; raises InvalidArgument where it can't have the scene."""
    version = _version(engine)
    methods = METHODS[engine]
    method = methods[0] if method is None else method
    if method not in methods:
        raise InvalidArgument(
            f"compare: {engine} has no method {method!r}{nearest(method, methods)} It has {', '.join(methods)}."
        )
    return RUNS[engine](scene, version, end, step, outputs, method, options)


def _version(engine):
    """The name of an engine with its version; raises MissingDependency where it isn't installed."""
    if not isinstance(engine, str) or engine not in METHODS:
        known = ", ".join(METHODS)
        raise InvalidArgument(
            f"compare: with_={engine!r} is no engine that is known{nearest(str(engine), METHODS)} There are {known}."
        )
    try:
        return f"{TITLES[engine]} {import_module(engine).__version__}"
    except ImportError as error:
        raise MissingDependency(f"compare(with_={engine!r}) needs {TITLES[engine]}: pip install {engine}.") from error


def _demand_none(engine, found):
    """Refuse a scene with parts that an engine can't have."""
    if found:
        lines = "\n".join(f"  {item.name}: {reason}" for item, reason in found[:10])
        more = f"\n  and {len(found) - 10} more" if len(found) > 10 else ""
        raise InvalidArgument(f"compare: {TITLES[engine]} can't have this scene:\n{lines}{more}")


def _time_dependent(scene):
    """Constraints that depend on time, or on functions of the user's."""
    return [
        (item, "it depends on time")
        for item in scene.constraints
        if any(not isinstance(value, (int, float)) for part in item.parts for value in part.parameters())
    ]


def _exudyn(scene, version, end, step, outputs, method, options):
    from . import exudyn_scene

    _demand_none("exudyn", [*exudyn_scene.refused(scene), *_time_dependent(scene)])
    _demand_known("exudyn", options, ())
    made = exudyn_scene.ExudynScene(scene)
    found = made.run(end, step, outputs, dependent=bool(scene.mobility().redundant), solver=method)
    if found is None:
        raise StepFailure(f"compare: {version} gave up with {method} and the step {step:g} s; take a smaller one.")
    (r, A, v, omega), seconds = found
    p = np.roll(Rotation.from_matrix(A.reshape(-1, 3, 3)).as_quat(), 1, axis=1).reshape(*A.shape[:2], 4)
    return EngineRun(version, method, made.times, *coordinates(scene, r, p, v, omega), seconds)


def _mujoco(scene, version, end, step, outputs, method, options):
    from . import mujoco_scene
    from .mujoco_scene import MujocoScene

    found = [*mujoco_scene.refused_joints(scene), *_time_dependent(scene)]
    _demand_none("mujoco", found or mujoco_scene.refused_forces(scene, mujoco_scene.spanning_tree(scene)[0]))
    _demand_known("mujoco", options, ("solref", "solimp"))
    (t, r, p, v, omega), seconds = MujocoScene(scene, **options).run(end, step, outputs, method)
    rigid = [i for i, body in enumerate(scene.bodies) if body.dimension == 7]
    return EngineRun(version, method, t, *coordinates(scene, r, p[:, rigid], v, omega[:, rigid]), seconds)


def _demand_known(engine, options, known):
    for name in options:
        if name not in known:
            words = f"It has {', '.join(known)}." if known else "It has none."
            raise InvalidArgument(f"compare: {engine} has no option {name!r}. {words}")


def coordinates(scene, r, p, v, omega):
    """(q, qd), shapes (k, n), of positions and velocities (k, b, 3), p and omega of rigid bodies alone."""
    q, qd, rigid = [], [], 0
    for i, body in enumerate(scene.bodies):
        q.append(r[:, i])
        qd.append(v[:, i])
        if body.dimension == 7:
            unit = p[:, rigid] / np.linalg.norm(p[:, rigid], axis=1, keepdims=True)
            q.append(unit)
            qd.append(0.5 * np.einsum("kij,ki->kj", transform_g(unit), omega[:, rigid]))
            rigid += 1
    return np.concatenate(q, axis=1), np.concatenate(qd, axis=1)


TITLES = {"mujoco": "MuJoCo", "exudyn": "Exudyn"}
METHODS = {
    "mujoco": ("euler", "rk4", "implicit", "implicitfast"),
    "exudyn": ("GeneralizedAlpha", "TrapezoidalIndex2", "RK44", "RK67", "ODE23", "DOPRI5"),
}
RUNS = {"mujoco": _mujoco, "exudyn": _exudyn}


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
    found = run(scene, with_, end - start, min(step, end - start), outputs, method, options or {})
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
