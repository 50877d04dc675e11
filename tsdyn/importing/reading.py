"""A scene of a file of another program; the root element of an .xml determines its kind."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..configuration.motor_starts import are_aligned
from ..configuration.tolerances import INITIAL_TOL
from ..errors import InvalidArgument, TsdynError
from ..observables.diagnostics import constraint_error
from . import loops, mjcf, sdf, urdf
from .building import build
from .reduction import complete, gather, merge
from .report import ImportReport
from .tolerances import HUGE, NO_MASS
from .xml_file import OutsideFiles, read

if TYPE_CHECKING:
    from ..hints import Callable, Place, Scene

FORMATS = {"robot": "URDF", "mujoco": "MJCF", "sdf": "SDF", "gazebo": "SDF"}


def load(path: Place, make: Callable[..., Scene], free_base: bool, outside: bool, given: Any = ()) -> Scene:
    """The scene of a URDF, MJCF or SDF file; arguments and errors as of `ts.load`.

    Parameters
    ----------
    path : str or PathLike
    make : callable
        Of an empty scene: `Scene`.
    free_base : bool
        Whether the root link of a URDF is free.
    outside : bool
        Whether files outside the folder of this one may be read.
    given : sequence of (frame_a, frame_b, kind)
        Loops to be closed.
    """
    root, mistakes = read(path)
    kind, path = FORMATS.get(root.tag), Path(path)
    files = OutsideFiles(path.parent, outside)
    if kind is None:
        known = "<robot> of URDF, <mujoco> of MJCF, <sdf> of SDF"
        root.wrong(f"the root element <{root.tag}> is of no known format; there are {known}.")
        mistakes.demand_none()
    if free_base and kind != "URDF":
        raise InvalidArgument(f"free_base is for URDF, where the file doesn't say it; {path} is {kind}.")
    report = ImportReport(str(path), kind)
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            if kind == "URDF":
                description = urdf.describe(root, files, report, free_base)
            elif kind == "SDF":
                description = sdf.describe(root, files, report)
            else:
                description = mjcf.describe(root, path, report, files)
    except RecursionError:
        root.wrong("elements or files are nested too deeply.")
        mistakes.demand_none()
    for link in description.links.values():
        numbers = (link.mass, *link.centroid, *link.inertia.flat, *link.frame.p, *link.start.p)
        if not np.abs(numbers).max() < HUGE:
            mistakes.add((link.line or 1, 1), f"link {link.name!r}: mass, inertia or place is beyond {HUGE:g}.")
    for joint in description.joints:
        if not np.abs((joint.start, *(() if joint.point is None else joint.point))).max() < HUGE:
            mistakes.add((1, 1), f"joint {joint.name!r}: its place or its offset is beyond {HUGE:g}.")
    mistakes.demand_none()
    loops.add_given(description, given)
    return _scene(description, make, report, mistakes)


def _scene(description: Any, make: Any, report: ImportReport, mistakes: Any) -> Scene:
    """Merge, complete and build; a body or joint that can't be built is a mistake of the file."""
    merge(description, report)
    gather(description, report)
    complete(description, report)
    if not description.links or not any(link.mass > NO_MASS for link in description.links.values()):
        mistakes.add((1, 1), "no link moves: all are fixed to the ground, or have no mass.")
    mistakes.demand_none()
    try:
        scene = build(description, make, report)
    except TsdynError as error:
        mistakes.add((1, 1), str(error))
        mistakes.demand_none()
    report.warn(_close(scene, report) if any(joint.loop for joint in description.joints) else 0.0)
    return scene


def _close(scene: Scene, report: ImportReport) -> float:
    """Assemble a scene whose loops are open, or mirrored, at the start; by how much they stay open."""
    q, qd = scene.start
    rest = np.zeros((1, q.size))
    gap = float(constraint_error(scene.packed, np.zeros(1), q[None], qd[None], rest).position[0])
    if gap <= INITIAL_TOL and are_aligned(scene.packed, q, 0.0):
        return 0.0
    try:
        scene.assemble()
        report.note(f"loops that were open by up to {gap:.2g} are closed by assembly")
        return 0.0
    except TsdynError as error:
        report.note(f"loops are open by up to {gap:.2g}, and can't be closed: {error}")
        return gap
