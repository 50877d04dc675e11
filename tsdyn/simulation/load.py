"""`load`: a scene or a solution of a file, and `Scene.save`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import validation
from ..calls import fitting
from ..errors import InvalidArgument, StorageError
from .prepared_run import simulate
from .resume import ended_run
from .scene import Scene
from .solution import Solution
from .stored_runs import demand_path

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..hints import Place

SCENES = (".toml", ".urdf", ".xml", ".mjcf", ".sdf", ".world")
READS = f"{', '.join(SCENES)} (a scene), .h5, .hdf5, .nc or .zarr (a solution or an ensemble)"
LOADERS = {}  # of files of packages above: by the name of the format, a function of path, scene and allow_code


@fitting
def load(
    path: Place,
    scene: Scene | None = None,
    *,
    allow_code: bool = False,
    free_base: bool = False,
    outside: bool = False,
    loops: Sequence[Sequence[Any]] = (),
    limits: bool = False,
) -> Any:
    """Return the scene, solution or ensemble of a file; nothing in it is executed.

    Parameters
    ----------
    path : str or PathLike
        A scene file (.toml); a URDF, MJCF or SDF file (.urdf, .xml, .mjcf, .sdf, .world); or a solution or ensemble
        (.h5, .hdf5, .nc, .zarr) that its method `save` has written, or the store of a run with checkpoints that has
        ended.
    scene : Scene, optional
        That of a solution or ensemble whose file holds none, because the scene has functions or classes of your own.
        Without it a solution can be looked at and converted: reactions, dense output and further runs are refused. A
        store doesn't tell multipliers, power, potential energy and constraint errors, which are NaN then.
    allow_code : bool
        Whether modules that a file names as those of plug-ins may be imported. Plug-ins that have been imported
        before are found anyway.
    free_base : bool
        Whether the root link of a URDF is free to move; else it is fixed to the ground.
    outside : bool
        Whether a URDF, MJCF or SDF file may name files outside its folder, such as meshes in a folder beside it, or
        files to include. Otherwise only those in its folder and in folders below are read; links are followed first.
    loops : sequence of (frame_a, frame_b, kind); optional
        Loops that a URDF, MJCF or SDF file leaves open: names of two of its links, frames, sites or joints, and how
        they are held together. "weld": they coincide; "ball": their origins do; "hinge": their origins and z axes do,
        or an axis in both frames that a fourth entry gives, such as (0, 1, 0). The scene is assembled;
        a warning and `scene.imported` say so where it can't be.
    limits : bool
        Whether limits of the joints of a URDF, MJCF or SDF file become stops, plastic ones named "limits of ...", and
        upper limits of the lengths of tendons through sites ropes that go slack.

    Returns
    -------
    Scene, Solution or Ensemble

    Raises
    ------
    InvalidFile
        If a scene file has mistakes; lists all with their lines.
    StorageError
        If a file can't be read, is damaged, foreign, or of a later version.
    MissingDependency
        If the parser of a format is not installed: `pip install 'tsdyn[import]'`.

    Warns
    -----
    ImportLosses
        If a URDF, MJCF or SDF file has what can't be carried over; `scene.imported` lists each.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> ts.load(scene.save(mkdtemp() + "/pendulum.toml"))
    <Scene of 1 point mass: 3 coordinates, 1 constraint row>
    """
    demand_path(path, "path")
    if not isinstance(allow_code, bool):
        raise InvalidArgument(f"allow_code must be True or False, got {allow_code!r}.")
    if not isinstance(free_base, bool):
        raise InvalidArgument(f"free_base must be True or False, got {free_base!r}.")
    if not isinstance(outside, bool):
        raise InvalidArgument(f"outside must be True or False, got {outside!r}.")
    if not isinstance(limits, bool):
        raise InvalidArgument(f"limits must be True or False, got {limits!r}.")
    loops = validation.sequence(
        loops, 'loops must be a sequence such as [("link_a", "link_b", "weld")]', InvalidArgument
    )
    suffix = Path(path).suffix.lower()
    if suffix in SCENES:
        if scene is not None:
            raise InvalidArgument("scene= is for solutions; a scene file holds its own.")
        return scene_file(path, allow_code, free_base, outside, loops, limits)[0]
    _demand_robot(free_base, outside, loops, limits)
    if suffix == ".xacro":
        raise InvalidArgument(f"{path}: expand the macros first, such as by xacro {path} > robot.urdf.")
    from ..files.formats import SUFFIXES
    from ..files.saved_file import STORE, kind_of
    from .resume import Outline
    from .saved_solutions import load as load_solution

    if suffix not in SUFFIXES:
        raise InvalidArgument(f"load reads files that end in {READS}, got {str(path)!r}.")
    kind = kind_of(Path(path))
    if kind == STORE:
        return ended_run(path, scene)
    if kind in LOADERS:
        return LOADERS[kind](path, scene, allow_code)
    return load_solution(path, scene, allow_code, (Scene, Solution, Outline))


def scene_file(
    path: Place,
    allow_code: bool = False,
    free_base: bool = False,
    outside: bool = False,
    loops: Any = (),
    limits: bool = False,
) -> tuple[Scene, dict[str, Any]]:
    """Return the scene of a file, and the arguments of `simulate` that the table `run` of a TOML file asks for."""
    if Path(path).suffix.lower() != ".toml":
        from ..importing.reading import load as imported

        return imported(path, Scene, free_base, outside, loops, limits), {}
    _demand_robot(free_base, outside, loops, limits)
    return document_of(path, allow_code)[:2]


def _demand_robot(free_base, outside, loops, limits):
    """Refuse options of the files of other programs."""
    if free_base:
        raise InvalidArgument("free_base= is for URDF files.")
    if outside:
        raise InvalidArgument("outside= is for URDF, MJCF and SDF files.")
    if limits:
        raise InvalidArgument("limits= is for URDF, MJCF and SDF files; other scenes have stops, ts.constraints.Stop.")
    if loops:
        raise InvalidArgument("loops= is for URDF, MJCF and SDF files; other scenes close loops by scene.add.")


def document_of(path: Place, allow_code: bool = False, study: Mapping[str, Any] | bool | None = None) -> Any:
    """Return the `Document` of a TOML file: its scene, and what its tables run, ensemble and output ask for.

    `study` has keys of the table ensemble, such as cases, in place of those of the file, where they are not None; a
    study of False leaves the table unread.
    """
    from ..files import scene_text

    return scene_text.read_all(text_of(path), os.fspath(path), Scene, simulate, allow_code, study)


def text_of(path: Place) -> str:
    """Return the text of a scene file; raises StorageError."""
    from ..files.scene_text import LARGEST

    try:
        return validation.read(path, LARGEST).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise StorageError(f"{path} is no text in UTF-8: {error}.") from error
