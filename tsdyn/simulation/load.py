"""`load`: a scene or a solution of a file, and `Scene.save`; `resume`: go on with a run from its checkpoint."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import validation
from ..calls import fitting
from ..errors import InvalidArgument, InvalidFile, StorageError
from ..observables.diagnostics import ConstraintError
from ..validation import clipped, damaged
from .prepared_run import Run, simulate
from .run_options import demand_arguments_of_file, from_names
from .scene import Scene
from .scene_cache import prepared_numbers
from .solution import Solution
from .stored_runs import Lacking, arguments_of, demand_path, demand_same_place, demand_same_scene

if TYPE_CHECKING:
    from ..hints import Event, Floats, Mapping, Place, Progress, Sequence

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
        Without it a solution can be inspected and converted: reactions, dense output and further runs are refused. A
        store lacks multipliers, power, potential energy and constraint errors, which are NaN then.
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
    flags = {"allow_code": allow_code, "free_base": free_base, "outside": outside, "limits": limits}
    for name, value in flags.items():
        if not isinstance(value, bool):
            raise InvalidArgument(f"{name} must be True or False, got {value!r}.")
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
        raise InvalidArgument("free_base= is for URDF files; leave it out.")
    if outside:
        raise InvalidArgument("outside= is for URDF, MJCF and SDF files; leave it out.")
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


# `resume`: go on with a run from its checkpoint.

NEEDED = ("scene", "functions"), ("events", "events")  # arguments that are passed again, and what says that they are


@fitting
def resume(
    path: Place,
    scene: Scene | None = None,
    events: Event | Sequence[Event] | None = None,
    *,
    progress: Progress | None = None,
) -> Solution:
    """Go on with a run from its last checkpoint, to the end that it was asked for: to the bits of one never stopped.

    Parameters
    ----------
    path : str or PathLike
        The store of a run that was made with `simulate(..., store=path, checkpoint=seconds)`.
    scene : Scene, optional
        Needed where the scene has functions, or classes, of your own: a file keeps no code. It must be the scene that
        was run, to the bit, and its functions must have the source that they had.
    events : callable or list of callables, optional
        Those of the run, where it had any; their source must be what it was.
    progress : bool or callable, optional
        As of `simulate`.

    Returns
    -------
    Solution
        Of the whole run. A run that has ended is returned as it is, and one that max_steps has stopped may make as many
        steps again; what was written after the last checkpoint is computed again.

    Raises
    ------
    StorageError
        If there is no checkpoint, if it is damaged, or of another scene, version or machine.

    Examples
    --------
    >>> import tempfile
    >>> import tsdyn as ts
    >>> bob = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=1.0, position=(1, 0, 0))
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground))
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> first = ts.simulate(scene, (0, 2), store=path, checkpoint=60.0)
    >>> ts.resume(path).reached
    2.0
    """
    from ..files import checkpoint

    demand_path(path, "path")
    return _resumed(path, *checkpoint.read(path), scene, events, progress)


def _resumed(path, numbers, arrays, scene, events=None, progress=None):
    """As of `resume`, with the numbers and the arrays of the checkpoint."""
    demand_same_place(path, numbers)
    if scene is None:
        scene = _scene_of(path, numbers, arrays)
    if not isinstance(scene, Scene):
        raise InvalidArgument(f"scene must be a ts.Scene, got {scene!r}.")
    demand_same_scene(path, prepared_numbers(scene).packed, numbers["scene"])
    with damaged("the checkpoint"):
        given = arguments_of(numbers["arguments"], arrays, scene)
        demand_arguments_of_file({**given, "store": path})
    given |= {"events": events, "progress": progress, "store": path, "checkpoint": numbers["interval"]}
    options, call = from_names(given)
    return Run(scene, options)._solve(call, (numbers, arrays))


def _scene_of(path, numbers, arrays):
    """The scene that a checkpoint holds."""
    from ..files import scene_text  # takes a while to import

    foreign = ", ".join(numbers["functions"]) or str(numbers["arguments"].get("lacks", ""))
    if not foreign and "scene" in arrays:
        try:
            return scene_text.read(arrays["scene"].tobytes().decode(), "its scene", Scene, None)[0]
        except (InvalidFile, UnicodeDecodeError) as error:
            foreign = str(error)
    raise Lacking(
        f"{path}: the scene has functions or classes of yours ({clipped(foreign)}), and a file keeps no code. Pass "
        "the scene: ts.resume(path, scene=scene)."
    )


def ended_run(path: Place, scene: Scene | None) -> Solution:
    """Return the solution of a store whose run has ended; raises StorageError that names the call for any other."""
    from ..files import checkpoint
    from ..files.formats import format_of
    from .saved_solutions import outlined_run

    if not any(place.exists() for place in checkpoint.place(path)):
        if "ensemble" in format_of(path).attributes(path):
            raise StorageError(
                f"{path} is the store of an ensemble. The call of ts.ensemble that made it, with resume=True, reads it "
                "and goes on with it; ensemble.save(path) writes an ensemble as a whole."
            )
        raise StorageError(
            f"{path} is the store of a run and has no checkpoint: it holds outputs, not what a solution needs beside "
            "them. Read the outputs by xarray (xarray.open_zarr, or xarray.open_dataset with engine='h5netcdf'), or "
            "run again with checkpoint=60.0; solution.save(path) writes a solution as a whole."
        )
    numbers, arrays = checkpoint.read(path)
    if numbers.get("ended"):
        try:
            return _resumed(path, {**numbers, "events": {}}, arrays, scene)
        except Lacking as error:
            if "outline" not in arrays:
                raise
            with damaged(path):
                return outlined_run(Path(path).absolute(), numbers, arrays, str(error), (Scene, Outline))
    passed = "".join(f", {needed}={needed}" for needed, known in NEEDED if numbers[known])
    raise StorageError(
        f"{path} is the store of a run that has not ended: its checkpoint is of t = {numbers['t']:.9g} s. "
        f"ts.resume({str(path)!r}{passed}) returns its solution, once it has gone on to the end."
    )


# Solutions of files whose scenes have functions, or classes, that are not here: read, not run.


class Outline(Solution):
    """A solution whose scene lacks the parts that a file names only: they are not drawn, and nothing is run.

    Outputs, kinematics, momenta and kinetic energy are those of the run. So are potential energy, power, multipliers
    and constraint errors of a saved solution; of a store they are NaN.
    """

    _held: dict[str, Any]  # arrays of the file
    _content: Any  # numbers and arrays of the file
    _columns: list[int]  # of what is remembered: the angles of the joints that are here
    _row_labels: list[list[str]]  # title and label of each row of Phi

    def _set_remembered(self, rest):
        self._all_remembered = rest
        super()._set_remembered(rest[:, self._columns])

    def _of_run(self, name):
        return self._held[f"held_{name}"][self._slice]

    @property
    def multipliers(self) -> Floats:  # type: ignore[override]
        """Multipliers (k, m) of the run."""
        return self._of_run("multipliers")

    @property
    def power(self) -> Floats:  # type: ignore[override]
        """Power of the run (k,), W."""
        return self._of_run("power")

    @property
    def potential_energy(self) -> Floats:  # type: ignore[override]
        """Potential energy of the run (k,), J."""
        return self._of_run("potential_energy")

    @property
    def constraint_error(self) -> ConstraintError:  # type: ignore[override]
        """Constraint errors of the run, (k,) each."""
        return ConstraintError(*(self._of_run(f"{level}_error") for level in ConstraintError._fields))


def _refused(name):
    def refuse(self, *_, **__):
        raise StorageError(f"solution.{name} needs the scene as it was run. {self._lacks}")

    return refuse


LOADS = "reaction", "reaction_unique", "contact_point", "friction_demand"
for _name in ("actuation", *LOADS, "rows", "sticking", "at", "power_of", "work_of"):
    setattr(Outline, _name, _refused(_name))
for _name in ("state", "work", "dissipation"):
    setattr(Outline, _name, property(_refused(_name)))
