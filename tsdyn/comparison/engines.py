"""The other engines: how a scene gets there, and what of it can't."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..elements.bodies import transform_g
from ..errors import InvalidArgument, MissingDependency, StepFailure
from ..validation import nearest

if TYPE_CHECKING:
    from ..hints import Floats, Scene


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
    from . import mujoco_forces, mujoco_tree
    from .mujoco_scene import MujocoScene

    found = [*mujoco_tree.refused(scene), *_time_dependent(scene)]
    _demand_none("mujoco", found or mujoco_forces.refused(scene, mujoco_tree.spanning_tree(scene)[0]))
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
