"""Editing of scenes: removal of bodies, constraints and forces, and copies of a scene."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from ..elements.bodies import Ground, PointMass
from ..elements.names import named
from ..errors import InvalidArgument, InvalidBody

if TYPE_CHECKING:
    from ..hints import Scene

SHOWN = 5  # in a message
WHAT = "body, constraint or force"  # has a name


def remove(scene: Scene, item: Any) -> Any:
    """Remove a body, constraint, joint or force from the scene; earlier solutions remain valid.

    Parameters
    ----------
    item : Body, constraint, joint, force or str
        A handle, or a unique name.

    Returns
    -------
    Body, constraint, joint or force
        The removed item. A constraint or force may be added again, a body may not.

    Raises
    ------
    InvalidArgument
        If the scene has no such item, the name is ambiguous, or a constraint or force refers to the item.

    Examples
    --------
    >>> import tsdyn as ts
    >>> block = (scene := ts.Scene()).add_body(mass=1.0, inertia=(1, 1, 1))
    >>> scene.add(ts.constraints.Fixed.at(block, scene.ground, name="clamp"))
    <Fixed 'clamp': 6 rows>
    >>> scene.remove("clamp"), scene.mobility().degrees_of_freedom
    (<Fixed 'clamp': 6 rows>, 6)
    """
    item = found(scene, item)
    users = _users(scene, item)
    if users:
        more = f" and {len(users) - SHOWN} more" if len(users) > SHOWN else ""
        raise InvalidArgument(
            f"{item.name!r} can't be removed: {', '.join(user.name for user in users[:SHOWN])}{more} refer to it. "
            "Remove these first."
        )
    if isinstance(item, PointMass):
        scene._bodies.remove(item)
        scene._normalisations.pop(item, None)
        for i, body in enumerate(scene._bodies):
            body.index = i
        item.index, scene._names = REMOVED, None
    else:
        members = scene._forces if any(item is force for force in scene._forces) else scene._added
        members[:] = [other for other in members if other is not item]
        item.__dict__["added"] = False
    scene._titles = None
    scene.touch()
    return item


REMOVED = -1  # index of a removed body


def demand_present(item, bodies):
    """Refuse a constraint or force on a body that has been removed from its scene."""
    for body in bodies:
        if isinstance(body, PointMass) and body.index == REMOVED:
            raise InvalidBody(f"{item}: {body.name!r} has been removed from its scene; add a body in its place.")


def found(scene, item):
    """Return the item of a handle or a unique name."""
    present = [*scene._bodies, *scene._added, *scene._forces]
    if isinstance(item, str):
        item = named([*present, *scene._normalisations.values()], item, WHAT)
    if any(item is other for other in present):
        return item
    if isinstance(item, Ground):
        raise InvalidArgument("the ground can't be removed.")
    if any(item is own for own in scene._normalisations.values()):
        raise InvalidArgument(f"{item.name} belongs to its body; remove the body.")
    owner = getattr(item, "owner", None)
    if owner is not None:
        raise InvalidArgument(f"{item.name} is a part of {owner.title}; remove that instead.")
    raise InvalidArgument(f"the scene has nothing like {item!r}: give a body, constraint or force of it, or a name.")


def _users(scene, item):
    """The constraints and forces that refer to an item."""
    return [
        other
        for other in (*scene._added, *scene._forces)
        if other is not item and any(value is item for value in vars(other).values())
    ]


def copy(scene: Scene) -> Scene:
    """Return an independent scene with handles of its own; `copy[handle]` is the counterpart of a handle of this scene.

    Returns
    -------
    Scene
        With the same names, numbers and functions; controller objects are copied, too.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene()
    >>> bob = scene.add_point_mass(mass=1.0, position=(1, 0, 0), name="bob")
    >>> heavy = scene.copy()
    >>> heavy[bob].mass = 5.0
    >>> print(bob.mass, heavy.body("bob").mass)
    1.0 5.0
    """
    memo = {}
    twin = deepcopy(scene, memo)
    own = (scene.ground, *scene._bodies, *scene._added, *scene._normalisations.values(), *scene._forces)
    for item in own:
        _freeze(vars(item), vars(memo[id(item)]))
        if isinstance(item, PointMass):
            _freeze(item.values, memo[id(item)].values)
    twin.gravity = scene.gravity
    twin._twins = WeakKeyDictionary((item, memo[id(item)]) for item in own)
    return twin


def _freeze(given, copied):
    """Make arrays read-only where the originals are: changes in place would not reach the packed numbers."""
    for name, value in given.items():
        pairs = zip(value, copied[name], strict=True) if isinstance(value, tuple) else ((value, copied[name]),)
        for one, other in pairs:
            if isinstance(one, np.ndarray) and not one.flags.writeable and one is not other:
                other.setflags(write=False)
