"""`resume`: go on with a run from its checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..calls import fitting
from ..errors import InvalidArgument, InvalidFile, StorageError
from ..observables.diagnostics import ConstraintError
from ..validation import clipped, damaged
from .prepared_run import Run
from .run_options import demand_arguments_of_file, from_names
from .scene import Scene
from .scene_cache import prepared_numbers
from .solution import Solution
from .stored_runs import Lacking, arguments_of, demand_path, demand_same_place, demand_same_scene

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..hints import ConstraintError as Errors
    from ..hints import Event, Floats, Place, Progress

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
    def constraint_error(self) -> Errors:  # type: ignore[override]
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
