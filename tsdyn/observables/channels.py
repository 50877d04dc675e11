"""Channels: quantities of bodies, joints and forces over time, by name and with units.

A name is that of an object, of a quantity of it, and of a component: "arm.position.z". Without the component it stands
for all of them, without the quantity for the natural set of the object.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..constraints import Distance
from ..elements.bodies import PointMass
from ..elements.element import AngleGeometry, Attachment
from ..elements.force import Force
from ..elements.loads import JointLoad
from ..errors import InvalidArgument, StorageError
from ..forces import Control, Spring
from ..model.handles import handles_of
from ..model.packed import has_friction, member_of
from ..validation import close, listed, sequence, shown
from .generalised_forces import law_values
from .reactions import loads_of, member
from .state import State

if TYPE_CHECKING:
    from ..hints import Callable, Floats, Packed, Sequence

AXES = (".x", ".y", ".z")
PARAMETERS = (".e0", ".e1", ".e2", ".e3")
KINDS = {"angle": ("rad", "rad/s", "rad/s^2"), "displacement": ("m", "m/s", "m/s^2")}
LISTED = 12  # names in a message


class Channel(NamedTuple):
    """One number over time."""

    name: str
    unit: str
    ask: Callable[[Any], Any]  # of a motion: a `Solution`, or states at k times; shared by the channels of one result
    pick: Callable[[Any], Floats]  # of what `ask` gives: (k,)
    quantity: str  # "angle", "angular velocity": what the axis of a figure is called

    @property
    def title(self) -> str:
        """Name and unit."""
        return f"{self.name} ({self.unit})"


def channels_of(packed: Packed, names: str | Sequence[str], lacks: str = "") -> list[Channel]:
    """Return the channels of some names, in their order, each once.

    Parameters
    ----------
    packed : Packed
        The scene.
    names : str or sequence of str
    lacks : str
        Which parts of the scene aren't there.

    Raises
    ------
    InvalidArgument
        If a name stands for no channel, or for those of several objects.
    """
    said = 'channels must be a name such as "hinge.angle", or a sequence of names'
    one = isinstance(names, (str, PointMass, Attachment))
    names = [names] if one else list(sequence(names, said, InvalidArgument))
    wrong = [name for name in names if not isinstance(name, str)]
    if wrong or not names:
        own = f"; its name is {wrong[0].name!r}" if wrong and isinstance(wrong[0], (PointMass, Attachment)) else ""
        raise InvalidArgument(f"{said}, got {shown(wrong[0] if wrong else names)}{own}.")
    known = ChannelNames(packed, lacks)
    return list({channel.name: channel for name in names for channel in known.meant(name)}.values())


def values_of(motion: Any, channels: Sequence[Channel]) -> Floats:
    """Return the values (k, channels) of channels along a motion."""
    asked = {channel.ask: None for channel in channels}
    asked = {ask: ask(motion) for ask in asked}
    return np.stack([channel.pick(asked[channel.ask]) for channel in channels], axis=1)


class ChannelNames:
    """The names of channels of a packed scene; `lacks` says which parts of the scene aren't there."""

    def __init__(self, packed, lacks):
        self.packed, self.lacks, self.things, handles = packed, lacks, {}, handles_of(packed)
        self.rows, self.known = {id(row.item): row for row in handles.rows}, {}
        self.names = {}
        for thing, name in zip((*handles.bodies, *handles.items), handles.names, strict=True):
            self.things.setdefault(name, []).append(thing)
            self.names[id(thing)] = name

    def meant(self, name):
        """The channels of a name; raises InvalidArgument unless it is that of one object."""
        titles = [title for title in _heads(name) if title in self.things]
        known = [self._by_name(thing) for title in titles for thing in self.things[title]]
        found = [channels[name] for channels in known if name in channels]
        if len(found) == 1:
            return found[0]
        if found:
            raise InvalidArgument(f"{name!r} is a channel of {len(found)} objects; give each a name of its own.")
        raise self._unknown(name, titles[0] if titles else "")

    def _unknown(self, name, title):
        """The error of a name that stands for no channel; `title` is that of the object which it begins with."""
        own = {each: None for thing in self.things.get(title, ()) for each in self._by_name(thing) if each != title}
        near = close(name, own or self.things) or close(name.partition(".")[0], self.things)
        said = [f"did you mean {' or '.join(map(repr, near))}?"] if near else []
        if own or not near:
            known = [each for each in own if each.rpartition(".")[0] not in own] or list(self.things)
            said.append(f"{'There' if said else 'there'} are {listed(known, LISTED)}.")
        return InvalidArgument(" ".join([f"no channel is named {name!r};", *said, self.lacks]).rstrip())

    def _by_name(self, thing):
        """The channels of an object, by each name that stands for some; found once: they share what is asked."""
        if id(thing) in self.known:
            return self.known[id(thing)]
        quantities, natural = _of_body(thing) if isinstance(thing, PointMass) else self._of_item(thing)
        found, title = {}, self.names[id(thing)]
        for key, (unit, parts, ask, pick) in quantities.items():
            name, quantity = f"{title}.{key}", key.partition(".")[0].replace("_", " ")
            picks = {part: partial(_component, pick, i) for i, part in enumerate(parts)} or {"": pick}
            found[name] = [Channel(name + part, unit, ask, one, quantity) for part, one in picks.items()]
            found |= {one.name: [one] for one in found[name]} if parts else {}
        found[title] = [one for key in natural for one in found[f"{title}.{key}"]]
        if isinstance(thing, Control):
            found[f"{title}.actuation"] = found[title]
        self.known[id(thing)] = found
        return found

    def _of_item(self, item):
        """Quantities of a constraint or force, and the natural ones; loads are those on `item.on`, ground frame."""
        row = self.rows.get(id(item))
        geometries = {} if row is None else {"angle": row.angles, "displacement": row.displacements}
        counts = {kind: len(found) for kind, found in geometries.items() if found}
        found, rate = _coordinates(item, counts), "rate" if len(counts) == 1 else "{}_rate"
        natural = [name for kind in counts for name in (kind, rate.format(kind))]
        exerted = partial(_refused, item, self.lacks) if self.lacks else partial(_asked, "reaction", item)
        loads = {name: (unit, AXES, exerted, partial(_at, i)) for i, (name, unit) in enumerate(LOADS)}
        main = list(loads)
        every = [one for found in geometries.values() for one in found]
        own = item.geometry if isinstance(item, JointLoad) else every[0] if len(every) == 1 else None
        if own is not None:
            i = int(isinstance(own, AngleGeometry))
            name, unit = LOADS[i]
            loads[f"{name}.axis"] = unit, (), partial(_along, item, own, i, exerted), _whole
            if item.drives or isinstance(item, Force):
                main = [f"{name}.axis"]
        own = member_of(self.packed, item)
        rolls = own is not None and any(hasattr(type(part), "contact") for part in self.packed.constraints[own.parts])
        if rolls or has_friction(self.packed, item):
            names = {"contact_point": ("m", AXES), "friction_demand": ("1", ())}
            for name, (unit, parts) in names.items():
                ask = partial(_refused, item, self.lacks) if self.lacks else partial(_asked, name, item)
                loads[name] = unit, parts, ask, _whole
            natural = ["contact_point"] if rolls else natural
        if isinstance(item, (Spring, Distance)):
            load = loads_of(self.packed).get(id(item)) or member(self.packed, item)
            ends = list(zip((item.a, item.b), load.coordinates, strict=True))
            found["length"] = "m", (), partial(_length, ends), _whole
            loads["tension"] = "N", (), partial(_tension, item, ends, exerted), _whole
            natural, main = ["length"], ["tension"]
        if isinstance(item, Control):
            ask = partial(_refused, item, self.lacks) if self.lacks else partial(_actuation, item)
            titles, units = item.titles(), [LOADS[action.turns][1] for action in item.actions()]
            main = [f"actuation.{title}" for title in titles]
            picks = [partial(_component, _whole, i) for i in range(len(main))]
            loads |= {name: (unit, (), ask, pick) for name, unit, pick in zip(main, units, picks, strict=True)}
        return found | loads, natural if self.lacks and natural else natural + main


LOADS = ("force", "N"), ("torque", "N m")


def _heads(name):
    """What a name begins with, up to each dot, the longest first."""
    words = name.split(".")
    return [".".join(words[:i]) for i in range(len(words), 0, -1)]


def _coordinates(item, counts):
    """Quantities of the coordinates of a joint, so many of each kind."""
    found = {}
    for kind, count in counts.items():
        parts = tuple(f" {i + 1}" for i in range(count)) if count > 1 else ()
        for level, unit in zip(("", "_rate", "_acceleration"), KINDS[kind], strict=True):
            found[kind + level] = unit, parts, partial(_asked, kind + level, item), _whole
            if level and len(counts) == 1:  # a joint of one kind: "hinge.rate", too
                found[level[1:]] = found[kind + level]
    return found


def _of_body(body):
    """Quantities of a body, and the natural ones."""
    units = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}
    natural = ["position", "velocity"]
    if body.dimension == 7:
        units |= {"angular_velocity": "rad/s", "angular_acceleration": "rad/s^2"}
        natural.append("angular_velocity")
    found = {name: (unit, AXES, partial(_asked, name, body), _whole) for name, unit in units.items()}
    if body.dimension == 7:
        found["orientation"] = "1", PARAMETERS, partial(_asked, "orientation", body), _whole
    return found, natural


# Values along a motion.


def _asked(name, thing, motion):
    return getattr(motion, name)(thing)


def _actuation(control, motion):
    load = loads_of(motion.packed).get(id(control)) or member(motion.packed, control)
    return law_values(motion, load, motion.memory if isinstance(motion, State) else motion._memory)


def _refused(item, lacks, motion):
    raise StorageError(f"what {item.name} exerts needs the scene as it was run. {lacks}")


def _whole(result):
    return result


def _at(i, result):
    return result[i]


def _component(pick, i, result):
    return pick(result)[:, i]


def _apart(ends, motion):
    """The vector (k, 3) from the first end to the second, ground frame."""
    x_a, x_b = (
        motion.position(body, s if body.dimension == 7 else None) if body.dimension else np.asarray(s)
        for body, s in ends
    )
    return x_b - x_a


def _length(ends, motion):
    return np.linalg.norm(_apart(ends, motion), axis=1)


def _tension(item, ends, exerted, motion):
    """The force (k,) on a towards b, positive where it pulls."""
    d, force = _apart(ends, motion), exerted(motion)[0]
    return np.einsum("ki,ki->k", force, d if item.on is item.a else -d) / np.linalg.norm(d, axis=1)


def _along(item, geometry, i, exerted, motion):
    """The force (0) or torque (1) along the coordinate, on its other body."""
    axis = np.cross(geometry.f, geometry.g) if i else np.array(geometry.e)
    if geometry.own.dimension == 7:
        axis = motion.rotation(geometry.own) @ axis
    along = (exerted(motion)[i] * axis).sum(axis=1)
    return along if item.on is geometry.other else -along
