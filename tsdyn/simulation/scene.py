"""The scene: bodies, constraints and forces, validated as they are added; its table, its files."""

from __future__ import annotations

import os
from collections import Counter
from contextlib import suppress
from functools import wraps
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Never

import numpy as np

from ..calls import fitting, fitting_methods, lacking
from ..configuration.assemble import assemble as _assemble
from ..configuration.mobility import mobility as _mobility
from ..configuration.motor_starts import demand_aligned, elsewhere
from ..configuration.set_joint_coordinates import set_joint
from ..constraints.euler_normalization import EulerNormalization
from ..drawing import html_table
from ..elements.bodies import IDENTITY, Body, Ground, PointMass, named
from ..elements.element import admit, stop_waiting
from ..elements.force import Force
from ..elements.joint import Joint
from ..elements.laws import SceneLaw
from ..elements.primitive import Primitive
from ..errors import InconsistentState, InvalidArgument, InvalidBody, InvalidConstraint, StorageError
from ..jit.code_hash import deep_hash
from ..model.equations import demand_compilable
from ..model.handles import handles_of, user_functions
from ..model.laws import seen_by
from ..model.packed import pack
from ..motions.prescribed import Motion
from ..motions.signals import Signal
from ..observables.evaluate import evaluate as _evaluate
from ..validation import counted, demand_known, finite, label, vector3
from .analyses import equilibrium as _equilibrium
from .analyses import linearise as _linearise
from .analyses import set_start as _set_start
from .given_motion import inverse_dynamics as _inverse_dynamics
from .given_motion import kinematics as _kinematics
from .phase_scenes import at_start, has_contacts, with_closed_contacts, with_closed_or_open_contacts
from .scene_cache import preparing
from .variants import HANDLES, WHAT, demand_present, found, make_handles
from .variants import activate as _activate
from .variants import copy as _copy
from .variants import deactivate as _deactivate
from .variants import parameters as _parameters
from .variants import place as _place
from .variants import remove as _remove
from .variants import with_parameters as _with_parameters

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..hints import AnyBody, ArrayLike, BodyLike, Floats, ImportReport, Item, Orientation, Packed, Place, System


# A scene in a line, and as a table for notebooks.

PARTICLE = 3  # coordinates of a point mass
SHOWN = 25  # rows at most of bodies, of constraints and of forces


def table(scene: Scene) -> str:
    """Bodies with their masses, constraints and forces with the bodies that they join."""
    bodies = [(body.name, type(body).__name__, f"{body.mass:g} kg") for body in scene.bodies]
    constraints = [one for one in scene.constraints if not getattr(one, "normalises", False)]
    rows = [*_rows(bodies), *_rows(map(_item, constraints)), *_rows(map(_item, scene.forces))]
    return html_table(rows, summary(scene).strip("<>"), ("name", "kind", ""))


def summary(scene: Scene) -> str:
    """What `repr` says of a scene."""
    rows = sum(part.all_rows for part in scene.primitives)
    n = sum(body.dimension for body in scene.bodies)
    points = sum(body.dimension == PARTICLE for body in scene.bodies)
    parts = [(len(scene.bodies) - points, "rigid body", "rigid bodies"), (points, "point mass", "point masses")]
    bodies = ", ".join(counted(*part) for part in parts if part[0]) or "no bodies"
    forces = f", {counted(len(scene.forces), 'force')}" if scene.forces else ""
    idle = sum(not item.active for item in (*scene.constraints, *scene.forces))
    idle = f", {idle} inactive" if idle else ""
    return f"<Scene of {bodies}: {counted(n, 'coordinate')}, {counted(rows, 'constraint row')}{forces}{idle}>"


def _item(item):
    names = [body.name for body in (item.a, item.b) if body is not None]
    return item.name, item._kind(), ", ".join(names) + "; inactive" * (not item.active)


def _rows(lines):
    lines = list(lines)
    return lines[:SHOWN] + [(f"and {len(lines) - SHOWN} more", "", "")] * (len(lines) > SHOWN)


# Methods of scenes with contacts, beside those of other scenes.


def _serving(name):
    """Decorate a method of scenes: with contacts, the function of this name in contact_analyses.py serves it.

    That is given the scene and the method, and the arguments of the call.
    """

    def decorate(function):
        own = getattr(function, "__wrapped__", function)  # `fitting` names the method that is called

        @wraps(function)
        def call(scene, *arguments, **keywords):
            if not has_contacts(scene):
                return own(scene, *arguments, **keywords)
            from . import contact_analyses

            return getattr(contact_analyses, name)(scene, own, *arguments, **keywords)

        return fitting(call)

    return decorate


# `Scene.save`.


@fitting
def save(scene: Scene, path: Place) -> Path:
    """Write the scene to a TOML file, from which `ts.load` returns it to the bit.

    Parameters
    ----------
    path : str or PathLike
        Ends in .toml. A file that is there is replaced.

    Returns
    -------
    Path

    Raises
    ------
    InvalidArgument
        If the scene has what a file can't hold: functions, named each, or a class of your own that keeps its arguments
        under other names.
    StorageError
        If the file can't be written.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import tsdyn as ts
    >>> stone = (scene := ts.Scene(gravity=(0, 0, -10))).add_point_mass(mass=0.5, position=(0, 0, 2), name="stone")
    >>> print(scene.save(mkdtemp() + "/stone.toml").read_text().strip())
    version = 1
    gravity = [0.0, 0.0, -10.0]
    <BLANKLINE>
    [[body]]
    name = "stone"
    type = "PointMass"
    mass = 0.5
    position = [0.0, 0.0, 2.0]
    """
    from ..files import scene_text

    if not isinstance(path, (str, os.PathLike)) or Path(path).suffix.lower() != ".toml":
        raise InvalidArgument(f"a scene is saved to a path that ends in .toml, got {path!r}.")
    return write_text(path, scene_text.write(scene, type(scene)))


def write_text(path: Place, text: str) -> Path:
    """Write a text file whole or not at all; raises StorageError."""
    path = Path(path)
    partial = path.with_name(f"{path.name}-partial-{os.getpid()}")
    try:
        partial.unlink(missing_ok=True)  # a link, perhaps
        with open(partial, "x", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.replace(partial, path)
    except (OSError, UnicodeError) as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise StorageError(f"{path} can't be written: {getattr(error, 'strerror', None) or error}.") from error
    return path


@fitting_methods
class Scene:
    """Bodies, constraints, forces and gravity.

    Parameters
    ----------
    gravity : array_like (3,), m/s^2; default (0, 0, -9.81)
        Acceleration of free fall, ground frame.

    Attributes
    ----------
    ground : Ground
        The inertial frame, to attach constraints to.
    bodies, constraints : tuple
        In the order added, joints as a whole; normalisation rows of the rigid bodies are last, in body order.
    primitives : tuple
        The primitives in the order of their rows, those of joints included.
    forces : tuple
        In the order added.
    imported : ImportReport or None
        What was left out of an imported file, and where its frames are.

    Notes
    -----
    `simulate` never changes a scene. After an attribute of a body is set, the next run updates changed numbers only.

    Examples
    --------
    A spherical pendulum has two degrees of freedom:

    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
    >>> scene
    <Scene of 1 point mass: 3 coordinates, 1 constraint row>
    >>> scene.mobility().degrees_of_freedom
    2
    >>> print(f"{ts.simulate(scene, (0, 0.5)).position('bob')[-1, 2]:.6f} m")
    -0.928200 m
    """

    @fitting
    def __init__(self, gravity: ArrayLike = (0.0, 0.0, -9.81)) -> None:
        self.ground = Ground(self)
        self._bodies, self._added, self._forces, self._normalisations = [], [], [], {}
        self._waiting, self._titles = {}, None  # see element.py
        self._users = None  # of compiled functions; what holds them, see `user_functions`
        self._names = None  # of ground and bodies; None if a body may have been renamed
        self._twins = None  # handle of the scene that this one is a copy of -> handle here
        self._aliases = None  # the same, where solutions may be asked by it; see variants.py
        self.gravity = gravity

    ground: AnyBody
    imported: ImportReport | None = None
    _named = None  # of a file with a table `parameters`: its `NamedNumbers`
    _phases = _opens = None  # of a scene with contacts, or inactive parts: see phase_scenes.py
    _pack = pack  # what packs it; of a phase its own
    _whole = None  # of a phase: the scene
    _base = None  # of a phase: the one whose graph and memory it shares, such as that in which all frictions hold
    _lacks = ""  # what is to be passed before it can be run; of the outline of a scene in a file

    def __setattr__(self, name: str, value: Never) -> None:
        """Set an existing attribute; refuse a misspelt one."""
        demand_known(self, name, ("ground",))
        super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        """Make the handles of a scene that `with_parameters` has returned."""
        if name not in HANDLES or "_later" not in self.__dict__:
            raise lacking(self, name)
        make_handles(self)
        return self.__dict__[name]

    @property
    def gravity(self) -> Floats:
        """Acceleration of free fall, ground frame, m/s^2, shape (3,)."""
        return self._gravity

    @gravity.setter
    def gravity(self, value: ArrayLike) -> None:
        self._gravity = vector3(value, "gravity (m/s^2)", InvalidArgument)
        self._gravity.setflags(write=False)
        self.touch()

    @property
    def bodies(self) -> tuple[Body | Any, ...]:
        """The bodies, in the order added."""
        return tuple(self._bodies)

    @property
    def constraints(self) -> tuple[Primitive | Joint, ...]:
        """The constraints in the order of their rows, joints as a whole."""
        return (*self._added, *self._normalisations.values())

    @property
    def shapes(self) -> dict[str, list[Any]]:
        """Name of a body, or "ground" -> its shapes, in its frame, where it has any; files of meshes are read now."""
        return {body.name: [*body.shape] for body in (self.ground, *self._bodies) if body._shape is not None}

    @property
    def primitives(self) -> tuple[Primitive, ...]:
        """The primitives in the order of their rows, those of joints included."""
        return tuple(part for constraint in self.constraints for part in constraint.parts)

    @property
    def forces(self) -> tuple[Force, ...]:
        """The forces, in the order added."""
        return tuple(self._forces)

    @fitting
    def add_body(
        self,
        mass: float,
        inertia: ArrayLike,
        position: ArrayLike = (0.0, 0.0, 0.0),
        orientation: Orientation = IDENTITY,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
        name: str = "",
        shape: Any = None,
    ) -> Body:
        """Add a rigid body and return its handle.

        Parameters
        ----------
        mass : float, kg
            Positive.
        inertia : array_like (3,) or (3, 3), kg m^2
            About the centroid, body frame; not negative, and no principal value above the sum of the other two.
        position, velocity : array_like (3,), m and m/s
            Of the centroid, ground frame.
        orientation : array_like (4,) or (3, 3), or scipy.spatial.transform.Rotation
            Euler parameters (e0, e1, e2, e3), scalar first; or the rotation matrix, as `solution.rotation` gives it.
            Body to ground; of unit length, or orthogonal, to 1e-6, then scaled.
        angular_velocity : array_like (3,), rad/s
            Body frame.
        name : str, optional
            Name in messages and lookups; default "body1", "body2", ...
        shape : shape of `ts.shapes`, or list of them; optional
            What the viewer draws, in the frame of the body. `**ts.shapes.box(...)` gives it with mass and inertia. By
            default the uniform solid with the mass and inertia.

        Returns
        -------
        Body

        Raises
        ------
        InvalidBody
            If a value is inadmissible, not finite or of a wrong shape, or the name is in use.
        InvalidArgument
            If shape is none.

        Examples
        --------
        >>> import tsdyn as ts
        >>> scene = ts.Scene()
        >>> top = scene.add_body(mass=30.0, inertia=(90, 90, 30), position=(0, 0, 1), angular_velocity=(0.5, 0, 12))
        >>> print(top, top.inertia.diagonal())
        <Body 'body1'> [90. 90. 30.]
        """
        values = {"mass": mass, "inertia": inertia, "position": position, "orientation": orientation}
        values |= {"velocity": velocity, "angular_velocity": angular_velocity}
        body = self._admit(Body, name, values | {"shape": shape})
        self._normalisations[body] = EulerNormalization(body, name=f"EulerNormalization({body.name})")
        stop_waiting(self._normalisations[body])
        return body

    @fitting
    def add_point_mass(
        self, mass: float, position: ArrayLike = (0.0, 0.0, 0.0), velocity: ArrayLike = (0.0, 0.0, 0.0), name: str = ""
    ) -> PointMass:
        """Add a particle of three coordinates and return its handle; arguments as for `add_body`.

        Examples
        --------
        >>> import tsdyn as ts
        >>> scene = ts.Scene()
        >>> ball = scene.add_point_mass(mass=1.0, position=(0, 0, 2), name="ball")
        >>> print(ball, ball.q)
        <PointMass 'ball'> [0. 0. 2.]
        """
        return self._admit(PointMass, name, {"mass": mass, "position": position, "velocity": velocity})

    def _admit(self, kind, name, values):
        if self._names is None:
            self._names = {"ground", *(body.name for body in self._bodies)}
        taken = self._names
        free = (f"body{i}" for i in count(len(self._bodies) + 1))
        name = label(name, kind.__name__, InvalidBody) or next(name for name in free if name not in taken)
        if name in taken:
            raise InvalidBody(f"the scene has a body named {name!r} already; choose another name.")
        body = kind(self, len(self._bodies), name, **values)
        self._bodies.append(body)
        taken.add(name)
        self.touch()
        return body

    def add(self, item: Item) -> Item:
        """Add a constraint or a force and return it; a second EulerNormalization of a body returns the existing one.

        Raises
        ------
        InvalidConstraint, InvalidForce
            If the item is neither, belongs to another scene, or was added before; if Numba can't compile a function of
            it, which is compiled here.

        Examples
        --------
        A name serves instead of a handle:

        >>> import tsdyn as ts
        >>> scene = ts.Scene(gravity=(0, 0, -10))
        >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
        >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, name="rod"))
        >>> scene["rod"] is rod
        True
        """
        if not isinstance(item, (Primitive, Joint, Force)):
            raise InvalidConstraint(
                f"{item!r} is not a constraint or force; pass an instance, such as ts.constraints.Spherical(...) or "
                "ts.forces.Spring(...)."
            )
        word, members = ("force", self._forces) if isinstance(item, Force) else ("constraint", self._added)
        item.place_in(self)
        if not hasattr(item, "coordinates"):
            raise item.error(f"{type(item).__name__}: its __init__ must call super().__init__(...).")
        if item.scene is not self:
            raise item.error(f"{item.name}: its bodies belong to another scene; use bodies of this one.")
        demand_present(item.name, (item.a, item.b))
        if item.owner is not None:
            raise item.error(f"{item.name}: it is a part of {item.owner.title}; add that instead.")
        if isinstance(item, Joint):
            item.parts  # noqa: B018  it says what is wrong with them
        stop_waiting(item)
        if type(item) is EulerNormalization:
            return self._normalisations[item.a]
        if item.added and any(item is other for other in members):
            raise item.error(f"{item.name}: it has been added to this scene before; add each {word} once.")
        demand_compilable(item)
        admit(self, item)
        item.added = True
        members.append(item)
        self.touch()
        return item

    def refresh(self) -> None:
        """Recompile user functions whose globals have changed since the scene was packed."""
        if self._packed is not None and self._users and _marks(self._users) != self._functions:
            for owner, _ in self._users:
                owner.forget()
            self.touch()

    def __getstate__(self):
        """Leave out the packed scene, which holds addresses of this process."""
        _ = self._bodies  # made, if they weren't
        gone = dict.fromkeys(("_packed", "_start", "_prepared", "_phases", "_users", "_twins", "_aliases"))
        return {**self.__dict__, **gone, "_spare": {}, "_waiting": {}}

    def touch(self) -> None:
        """Discard the packed numbers after a change."""
        if "_later" in self.__dict__:
            make_handles(self)
        self._packed = self._start = self._prepared = self._phases = self._opens = None

    def touch_start(self) -> None:
        """Discard what depends on the start, after a change of it: redundant rows, bodies that turn, a local origin."""
        known = None if self._packed is None else self._packed.derived
        if self._phases is not None:
            for phase in self._phases.values():  # one of them may be at work
                phase._start = None
            self._phases = None
        if known is not None and known.is_of_start:
            self.touch()
        elif known is not None:
            known.family = known.arms = None
        self._start = None

    @property
    def packed(self) -> Packed:
        """The scene as a `Packed`; packed again only after a change. Raises InvalidBody without bodies."""
        if self._packed is None:
            if not self._bodies:
                raise InvalidBody("the scene has no bodies; add one with scene.add_body(...).")
            self._packed = self._pack()
            if self._aliases:
                handles_of(self._packed).add_aliases(self._aliases.items())
            self._users = list(user_functions(self._packed))
            self._functions = _marks(self._users)
        return self._packed

    @property
    def system(self) -> System:
        """The arrays that kernels read, a `System`."""
        return self.packed.system

    def motions(self) -> list[Any]:
        """The functions of time and tables of constraints and forces."""
        given = [*self.packed.parameters, *(load.parameters for load in self.packed.loads)]
        return [value for values in given for value in values if isinstance(value, (Motion, Signal))]

    @property
    def start(self) -> tuple[Floats, Floats]:
        """Initial (q, qd) of the bodies, shapes (n,), (n,)."""
        return tuple(array.copy() for array in self._initial())

    def _initial(self):
        """The same, until the scene changes the same arrays, not to be written to."""
        start = self._start
        if start is None:
            with preparing:
                start = self._start
                if start is None:
                    q, qd = (np.concatenate([getattr(body, x) for body in self._bodies]) for x in ("q", "qd"))
                    self._start = start = q, qd
        return start

    def body(self, name: str) -> Body | Any:
        """Return the body of this name.

        Raises
        ------
        InvalidBody
            If there is none.
        """
        for body in self._bodies:
            if isinstance(name, str) and body.name == name:
                return body
        raise InvalidBody(f"no body is named {name!r}; there are {', '.join(b.name for b in self._bodies) or 'none'}.")

    def __getitem__(self, item: Any) -> Any:
        """The body, constraint or force of a name, or, in a copy, the counterpart of a handle of the original."""
        if isinstance(item, str):
            return named([self.ground, *self._bodies, *self.constraints, *self._forces], item, WHAT)
        _ = self._bodies  # made, if they weren't
        known = isinstance(item, (PointMass, Ground, Primitive, Joint, Force))
        twin = self._twins.get(item) if self._twins is not None and known else None
        return found(self, item) if twin is None else twin

    def row_names(self) -> list[str]:
        """Return the names of the rows of Phi, in order: title of the constraint, and label of the row."""
        names, seen = [], Counter()
        for constraint in self.constraints:
            title = constraint.title
            seen[title] += 1
            again = "" if seen[title] == 1 else f" #{seen[title]}"
            names += [f"{title}{again}{label}" for label in constraint.row_labels]
        return names

    def view(
        self,
        path: str | Path | None = None,
        *,
        t: float = 0.0,
        shapes: Mapping[Any, Any] | None = None,
        camera: ArrayLike | None = None,
        follow: BodyLike | None = None,
    ) -> Any:
        """Show the scene at its start, assembled or not, as an interactive page; nothing is run.

        Violated rows of constraints are named in red, with their values, and the constraints drawn in red. The page
        also says where a motor's joint stands elsewhere, and which joints are mirrored.

        Parameters
        ----------
        path : str or Path, optional
            The file to write, as for `Solution.view`.
        t : float, s
            Time at which rheonomic constraints are to hold.
        shapes : dict, optional
            Body, ground or name -> what to draw for it, as for `Solution.view`.
        camera : array_like (3,) or (2, 3), optional
            As for `Solution.view`.
        follow : Body or str, optional
            The body that the camera is near.

        Returns
        -------
        Path, or View in a notebook

        Raises
        ------
        InvalidArgument
            If a shape or the camera is none, or the file can't be written.
        InvalidBody
            If the scene has no bodies, or not one of these.
        MissingDependency
            If matplotlib is not installed, which draws GIFs.

        Examples
        --------
        A rod of 1 m between points that are 1.2 m apart:

        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import tsdyn as ts
        >>> scene = ts.Scene()
        >>> bob = scene.add_point_mass(mass=1.0, position=(1.2, 0, 0), name="bob")
        >>> rod = scene.add(ts.constraints.Distance(bob, scene.ground, length=1.0, name="rod"))
        >>> with TemporaryDirectory() as folder:
        ...     page = scene.view(Path(folder) / "sketch.html")
        ...     print("rod: Phi = 0.22" in page.read_text())
        True
        """
        from ..graphics.run_data import scene_data
        from ..graphics.view import show

        t, packed, (q, qd) = finite(t, "view: t (s)"), self.packed, self.start
        try:
            demand_aligned(packed, q, t)  # rows hold on the mirrored branch, too
            said = elsewhere(packed, t, q, qd)
        except InconsistentState as error:
            said = [str(error)]
        return show(scene_data(self, at_start(self).packed, t, said, shapes=shapes, camera=camera, follow=follow), path)

    place = _place
    evaluate = _serving("evaluate")(_evaluate)
    assemble = with_closed_contacts(_assemble)
    mobility = with_closed_contacts(_mobility)
    linearise = _serving("linearise")(_linearise)
    equilibrium = _serving("equilibrium")(_equilibrium)
    kinematics = _serving("along")(_kinematics)
    inverse_dynamics = _serving("along")(_inverse_dynamics)
    parameters = _parameters
    with_parameters = _with_parameters
    set = with_closed_or_open_contacts(set_joint)
    set_start = _serving("set_start")(_set_start)
    remove = _remove
    activate = fitting(_activate)
    deactivate = fitting(_deactivate)
    copy = _copy
    save = save
    __copy__ = _copy

    def _repr_html_(self) -> str:
        """Return bodies, constraints and forces as a table, for notebooks."""
        return table(self)

    def __repr__(self) -> str:
        return summary(self)


def _marks(users):
    """Return the dependences of compiled user functions."""
    return [
        (seen_by if isinstance(owner, SceneLaw) else deep_hash)(function)
        for owner, functions in users
        for function in functions
    ]
