"""`compare`: a scene in another engine, against tsdyn at 1e-12."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..calls import fitting
from ..drawing import BLUE, VERMILION, ZERO, Tabulated, new_figure
from ..elements.bodies import transform_g
from ..errors import InvalidArgument
from ..observables import diagnostics
from ..runs.task import interval
from ..simulation.prepared_run import simulate
from ..validation import nearest, positive, whole
from .benchmark import poses
from .engines import ENGINES

if TYPE_CHECKING:
    from ..hints import Floats, Scene

# `Comparison`: how far the run of another engine is from the reference.


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
            error.semilogy(self.t, np.maximum(self.error, ZERO), color=VERMILION, label="position (m)")
            angle = np.maximum(self.rotation_error.max(axis=1), ZERO)
            error.semilogy(self.t, angle, color=VERMILION, linestyle="--", label="rotation (rad)")
            error.set(xlabel="time (s)", ylabel="largest error", title=f"{self.engine}, {self.method}, {self.step:g} s")
            for one, colour, name in ((self.theirs, VERMILION, self.engine), (self.ours, BLUE, "tsdyn")):
                violation.semilogy(self.t, np.maximum(one.position, ZERO), color=colour, label=name)
                violation.semilogy(self.t, np.maximum(one.velocity, ZERO), color=colour, linestyle="--")
                change = np.maximum(np.abs(one.energy - one.energy[0]), ZERO)
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
    """Run a scene in another engine, at the step that you use there, and measure the errors of that run.

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
    engine = _engine(with_)
    if method is not None and method not in engine.methods:
        known = f"{nearest(method, engine.methods)} It has {', '.join(engine.methods)}."
        raise InvalidArgument(f"compare: {with_} has no method {method!r}{known}")
    version, method, options = engine.version(), method or engine.methods[0], options or {}
    engine.demand(scene)
    for name in options:
        if name not in engine.options:
            known = f"It has {', '.join(engine.options)}." if engine.options else "It has none."
            raise InvalidArgument(f"compare: {with_} has no option {name!r}. {known}")
    found = engine(scene, **options).run(end - start, min(step, end - start), outputs, method)
    finite = np.isfinite([np.abs(part).reshape(len(found.t), -1).max(axis=1) for part in found[1:5]]).all(axis=0)
    kept = len(finite) if finite.all() else int(finite.argmin())
    t, r, A, v, omega = (part[:kept] for part in found[:5])
    t = start + t
    q, qd = _coordinates(scene, r, A, v, omega)
    tight = {"rtol": TOLERANCE, "atol": TOLERANCE, "constraint_tol": 1e-13}
    simulate(scene, (start, start + SHORT * (end - start)), **tight)  # loads kernels
    begun = perf_counter()
    ours = simulate(scene, (start, end), t_eval=np.minimum(t, end), **tight).raise_if_failed()
    seconds = perf_counter() - begun
    r_ours, A_ours = poses(ours)
    half_chord = np.linalg.norm(A - A_ours, axis=(2, 3)) / np.sqrt(8.0)  # |A - B| = sqrt(8) sin(angle / 2)
    return Comparison(
        engine=version, method=method, step=step, t=t, names=tuple(body.name for body in scene.bodies),
        position_error=np.linalg.norm(r - r_ours, axis=2), rotation_error=2.0 * np.arcsin(np.minimum(half_chord, 1.0)),
        theirs=_levels(ours, t, q, qd), ours=_levels(ours, t, ours.q, ours.qd), seconds=found.seconds,
        reference_seconds=seconds, reached=bool(kept == len(finite)),
    )  # fmt: skip


def _engine(name):
    if not isinstance(name, str) or name not in ENGINES:
        known = f"{nearest(str(name), ENGINES)} There are {', '.join(ENGINES)}."
        raise InvalidArgument(f"compare: with_={name!r} is no engine that is known{known}")
    return ENGINES[name]


def _coordinates(scene, r, A, v, omega):
    """(q, qd), shapes (k, n), of the bodies' positions, rotation matrices and velocities."""
    q, qd = [], []
    for i, body in enumerate(scene.bodies):
        q.append(r[:, i])
        qd.append(v[:, i])
        if body.dimension == 7:
            q.append(np.roll(Rotation.from_matrix(A[:, i]).as_quat(), 1, axis=1))
            qd.append(0.5 * np.einsum("kij,ki->kj", transform_g(q[-1]), omega[:, i]))
    return np.concatenate(q, axis=1), np.concatenate(qd, axis=1)


def _levels(ours, t, q, qd):
    """Constraint violation and energy of a trajectory; angles count the turns of ours."""
    packed, memory = ours.packed, ours._memory
    error = diagnostics.constraint_error(packed, t, q, qd, np.zeros_like(q), memory)
    forces = diagnostics.force_powers(SimpleNamespace(t=t, q=q, qd=qd, _memory=memory, packed=packed))
    energy = diagnostics.kinetic_energy(packed.system, q, qd) + diagnostics.potential_energy(packed.system, q)
    return Levels(error.position, error.velocity, energy + forces.potential)
