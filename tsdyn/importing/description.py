"""What a file of a robot says, whatever its format, and the report of what is lost."""

from __future__ import annotations

import html
import warnings
from dataclasses import dataclass, field
from itertools import chain, count
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..calls import line_of_user
from ..errors import ImportLosses
from ..validation import counted

# What a file describes: links, joints and forces, at zero joint coordinates; frames and free names.

# Frames: a place and a rotation, in the ground frame or in that of another frame.


class Frame(NamedTuple):
    """A frame in another one."""

    p: Any  # (3,), m
    R: Any  # (3, 3), from this frame to the other

    def __matmul__(self, inner):
        """The frame `inner`, which is given in this one, in the other."""
        return Frame(self.point(inner.p), self.R @ inner.R)

    def point(self, x):
        """A point of this frame in the other."""
        return self.p + self.R @ x

    def seen(self, x):
        """A point of the other frame in this one."""
        return self.R.T @ (x - self.p)

    @property
    def inverse(self):
        """The other frame in this one."""
        return Frame(-self.R.T @ self.p, self.R.T)


HERE = Frame(np.zeros(3), np.eye(3))


def posed(p, wxyz):
    """A frame of a place and a quaternion, scalar first."""
    return Frame(np.array(p), of_quaternion(wxyz))


def of_body(data, i):
    """The frame of a body of MuJoCo's, in the ground frame."""
    return Frame(data.xpos[i].copy(), data.xmat[i].reshape(3, 3).copy())


def turned(rotation_vector):
    """A rotation about the origin."""
    return Frame(np.zeros(3), Rotation.from_rotvec(rotation_vector).as_matrix())


def shifted(by):
    """A translation."""
    return Frame(np.asarray(by, float), np.eye(3))


def roll_pitch_yaw(angles, *, degrees=False):
    """Rotation about the fixed axes x, y, z, one after another, (3, 3)."""
    return Rotation.from_euler("xyz", angles, degrees=degrees).as_matrix()


def of_quaternion(wxyz):
    """Rotation matrix of a quaternion, scalar first."""
    return Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()


# Names that are in use by nothing else.


def fresh(name, taken):
    """The name, or with a number behind it where it is taken."""
    return next(one for one in chain([name], (f"{name} {i}" for i in count(2))) if one not in taken)


GROUND = ""  # in place of the name of a link


@dataclass(eq=False)
class Link:
    """A rigid body, or a frame without mass."""

    name: str
    frame: Frame = HERE  # in the ground frame, at zero joint coordinates
    mass: float = 0.0  # kg
    centroid: Any = field(default_factory=lambda: np.zeros(3))  # (3,), m, own frame
    inertia: Any = field(default_factory=lambda: np.zeros((3, 3)))  # about the centroid, kg m^2, own frame
    shapes: list = field(default_factory=list)  # `drawn_shapes.DrawnShape`s, own frame
    helps: bool = False  # stands between joints without mass of its own: where it has no shape, nothing is drawn
    line: int = 0  # of the file
    start: Frame = HERE  # in the ground frame, at the start, where joints have one


class Slide(NamedTuple):
    """One of the displacements of a joint that has several."""

    name: str
    axis: Any  # (3,), ground frame
    stiffness: float
    damping: float
    free: float
    load: float


class Servo(NamedTuple):
    """Spring, damper and constant load of an actuator on a joint; as those of a `JointItem`."""

    name: str
    stiffness: float
    damping: float
    free: float
    load: float


@dataclass(eq=False)
class JointItem:
    """A joint; a and b are names of links, points and axes are in the ground frame."""

    name: str
    kind: str  # revolute, prismatic, spherical, fixed, free, universal, planar, cylindrical, screw, translations
    a: str
    b: str
    point: Any = None  # (3,), m
    axis: Any = None  # (3,)
    axis_b: Any = None  # of a universal joint, the one fixed in b
    stiffness: float = 0.0  # N m/rad or N/m
    damping: float = 0.0  # N m s/rad or N s/m
    free: float = 0.0  # coordinate at which the spring is relaxed, from the start: rad or m
    load: float = 0.0  # constant torque or force on b, N m or N
    armature: float = 0.0  # inertia of its rotor, felt at the joint: kg m^2 or kg
    lead: float = 0.0  # of a screw, m/rad
    start: float = 0.0  # coordinate at the start, rad or m
    loop: bool = False  # holds beside the tree, so it is never merged
    frame_a: Any = None  # of a loop: frames of a and b that coincide, ground frame
    frame_b: Any = None
    slides: list = field(default_factory=list)  # `Slide`s, of translations and planar
    servos: list = field(default_factory=list)

    def normal(self):
        """Across its two slides, (3,)."""
        n = np.cross(self.slides[0].axis, self.slides[1].axis)
        return n / np.linalg.norm(n)


@dataclass(eq=False)
class TendonItem:
    """A spring between two points, or a cable or rope through several."""

    name: str
    kind: str  # spring, cable, rope, limit
    points: list  # pairs: the name of a link, a point (3,) in the ground frame, m
    length: float  # where it has no tension, m
    stiffness: float = 0.0
    damping: float = 0.0


@dataclass(eq=False)
class Coupling:
    """q_follower = offset + the drivers' coordinates times their ratios, or + a polynomial of one driver's, or of none.

    Coordinates are named by (joint, index), the index being that of a universal joint's axis.
    """

    name: str
    follower: tuple
    drivers: tuple
    ratios: tuple
    offset: float = 0.0  # rad or m
    polynomial: tuple = ()  # in place of a ratio and an offset


@dataclass(eq=False)
class Description:
    """A file's content."""

    title: str
    gravity: Any = (0.0, 0.0, -9.81)
    links: dict = field(default_factory=dict)  # Link by name, in the order of the file
    joints: list = field(default_factory=list)
    tendons: list = field(default_factory=list)
    couplings: list = field(default_factory=list)
    frames: dict = field(default_factory=dict)  # name -> (name of a link, Frame in it)
    ground_shapes: list = field(default_factory=list)

    def frame_of(self, name):
        """The frame of a link, or of the ground."""
        return HERE if name == GROUND else self.links[name].frame

    def joints_by_link(self):
        """The joints of each link and of the ground, by name, in order."""
        found = {name: {} for name in (GROUND, *self.links)}
        for joint in self.joints:
            found[joint.a][joint] = found[joint.b][joint] = None
        return found


# What became of a file: what was left out, what was carried over in another way, and where its frames are.

SHOWN = 8  # names of a group in a text
UNBOUNDED = 1e3  # rad or m: a range from which on limits say nothing on where a loop closes
UNLIMITED = 1e16  # rad or m: a bound that is none, by the specification of SDF


class LeftOut(NamedTuple):
    """A thing that the scene lacks: what it is, its name in the file, and its numbers or the reason."""

    what: str
    where: str
    detail: str = ""


class FrameOn(NamedTuple):
    """A frame of the file on a body of the scene: in the frame of the body, which is at its centroid."""

    body: str
    position: Any  # (3,), m
    rotation: Any  # (3, 3), from this frame to that of the body


class ImportReport:
    """What a file of another program became.

    Attributes
    ----------
    source, format : str
        The file, and "URDF", "MJCF" or "SDF".
    left_out : tuple of (what, where, detail)
        What the scene lacks.
    notes : tuple of str
        What was carried over in another way.
    frames : dict
        Name of a link, site or frame of the file -> (body, position, rotation) in the scene; so links that were merged
        into another one are found again.
    limits : dict
        Name of a joint with limits in the file -> (lower, upper), rad or m; hints of `scene.assemble`.
    stops : dict
        (joint, index of its angle) -> the same for `limits=True`, of any size; None where a side has no bound.

    Examples
    --------
    >>> import tsdyn as ts
    >>> ts.Scene().imported is None
    True
    """

    def __init__(self, source: str, format: str) -> None:
        self.source, self.format = source, format
        self._left: dict[LeftOut, None] = {}  # once each, in order
        self._notes: dict[str, None] = {}
        self.frames: dict[str, FrameOn] = {}
        self.limits: dict[str, tuple[float, float]] = {}
        self.stops: dict[tuple[str, int], tuple[float | None, float | None]] = {}

    @property
    def left_out(self) -> tuple[LeftOut, ...]:
        """What the scene lacks."""
        return tuple(self._left)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was carried over in another way."""
        return tuple(self._notes)

    def leave(self, what: str, where: str, detail: str = "") -> None:
        """Note what is left out, once."""
        self._left[LeftOut(what, where, detail)] = None

    def leave_limits(self, joint: str, lower: float, upper: float, shown: str = "", axis: int = 0) -> None:
        """Note the limits of a joint's axis: bounds of a stop, and of the first axis hints of an assembly."""
        if not axis and 0.0 < upper - lower < UNBOUNDED:
            self.limits[joint] = lower, upper
        lowest, highest = (bound if abs(bound) < UNLIMITED else None for bound in (lower, upper))
        if lowest != highest:  # equal bounds are those of exporters that have none
            self.stops[joint, axis] = lowest, highest
        self.leave("limits of a joint", joint, shown or f"[{lower:g}, {upper:g}]")

    def carry(self, what: str, where: str) -> None:
        """Note that something has been carried over after all."""
        self._left = {entry: None for entry in self._left if (entry.what, entry.where) != (what, where)}

    def note(self, text: str) -> None:
        """Note what is carried over in another way, once."""
        self._notes[text] = None

    def leave_unread(self, root: Any, file: str = "") -> None:
        """Note what nobody has asked a root element for; `file` stands before the line of an included one."""
        for name, line in root.unread():
            self.leave(f"element {name}" if " " not in name else f"attribute {name}", f"{file}line {line}")

    def groups(self) -> dict[str, list[LeftOut]]:
        """What is left out, by what it is."""
        found: dict[str, list[LeftOut]] = {}
        for entry in self._left:
            found.setdefault(entry.what, []).append(entry)
        return found

    def summary(self) -> str:
        """What is left out in one line; empty if nothing is."""
        parts = [f"{len(entries)} x {what}" for what, entries in self.groups().items()]
        return "; ".join(parts)

    def warn(self, open_by: float = 0.0) -> None:
        """Warn where something is left out, or loops stay open, by the largest residual."""
        said = [f"not carried over: {self.summary()}"] if self._left else []
        said += [f"its loops are open by up to {open_by:.2g}, and can't be closed"] if open_by else []
        if said:
            warnings.warn(
                ImportLosses(f"{self.source}: {'; '.join(said)}. print(scene.imported) lists all."),
                stacklevel=line_of_user(),
            )

    def __str__(self) -> str:
        lines = [f"{self.source} ({self.format})"]
        if not self._left:
            lines.append("everything is carried over")
        else:
            lines.append(f"not carried over: {counted(len(self._left), 'entry', 'entries')}")
        for what, entries in self.groups().items():
            lines.append(f"  {what} ({len(entries)}): {_listed(entries)}")
        return "\n".join([*lines, *(f"  note: {text}" for text in self._notes)])

    def __repr__(self) -> str:
        return f"<ImportReport of {self.source}: {self.summary() or 'everything is carried over'}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


def _listed(entries):
    parts = [f"{entry.where} {entry.detail}".strip() for entry in entries[:SHOWN]]
    more = f", and {len(entries) - SHOWN} more" if len(entries) > SHOWN else ""
    return ", ".join(parts) + more
