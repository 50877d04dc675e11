"""What a file describes: links, joints and forces, at zero joint coordinates, in the ground frame."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .frames import HERE, Frame

GROUND = ""  # in place of the name of a link


@dataclass(eq=False)
class Link:
    """A rigid body, or a frame without mass."""

    name: str
    frame: Frame = HERE  # in the ground frame, at zero joint coordinates
    mass: float = 0.0  # kg
    centroid: Any = field(default_factory=lambda: np.zeros(3))  # (3,), m, own frame
    inertia: Any = field(default_factory=lambda: np.zeros((3, 3)))  # about the centroid, kg m^2, own frame
    shapes: list = field(default_factory=list)  # `shapes.DrawnShape`s, own frame
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
class SpringItem:
    """A spring between two points, in the ground frame."""

    name: str
    a: str
    b: str
    point_a: Any
    point_b: Any
    stiffness: float
    damping: float
    free_length: float


@dataclass(eq=False)
class Coupling:
    """q_follower = ratio q_driver + offset."""

    name: str
    driver: str
    follower: str
    ratio: float
    offset: float = 0.0  # rad


@dataclass(eq=False)
class Description:
    """A file's content."""

    title: str
    gravity: Any = (0.0, 0.0, -9.81)
    links: dict = field(default_factory=dict)  # Link by name, in the order of the file
    joints: list = field(default_factory=list)
    springs: list = field(default_factory=list)
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
