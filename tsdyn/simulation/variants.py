"""Other scenes of a scene: copies, removal of parts, other numbers that share the analysis."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from copy import deepcopy
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from ..calls import fitting
from ..elements.bodies import START, Ground, PointMass, named
from ..elements.unilateral import contacts_of
from ..errors import InvalidArgument, InvalidBody, TsdynError
from ..model.handles import classes, handles_of
from ..validation import listed
from .scene_cache import prepared_numbers

if TYPE_CHECKING:
    from ..hints import Floats, ItemLike, ParameterList, Scene


# Editing of scenes: removal of bodies, constraints and forces, and copies of a scene.

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
        raise InvalidArgument(
            f"{item.name!r} can't be removed before what refers to it: {listed([user.name for user in users], SHOWN)}."
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


def deactivate(scene: Scene, item: ItemLike) -> Any:
    """Leave a constraint or force out at the start of runs, until the action of an event activates it.

    Analyses and assembly leave it out, too. A file of the scene says so.

    Parameters
    ----------
    item : constraint, joint, force or str
        A handle, or a unique name.

    Returns
    -------
    constraint, joint or force
        The item; its `active` is False.

    Raises
    ------
    InvalidArgument
        If the scene has no such item, or it can't come and go: a body, a normalisation, an `Armature`.

    Examples
    --------
    >>> import tsdyn as ts
    >>> block = (scene := ts.Scene()).add_body(mass=1.0, inertia=(1, 1, 1))
    >>> scene.add(ts.constraints.Fixed.at(block, scene.ground, name="clamp"))
    <Fixed 'clamp': 6 rows>
    >>> scene.deactivate("clamp").active, scene.mobility().degrees_of_freedom
    (False, 6)
    """
    return _switched(scene, item, False)


def activate(scene: Scene, item: ItemLike) -> Any:
    """Let a constraint or force take part again that `deactivate` has left out; arguments and errors as there."""
    return _switched(scene, item, True)


def _switched(scene, item, active):
    item = switchable(scene, item)
    item.__dict__["active"] = active
    scene.touch()
    return item


def switchable(scene, item):
    """Return the constraint or force of a handle or name, which may come and go."""
    item = found(scene, item)
    if isinstance(item, PointMass):
        raise InvalidArgument(f"{item.name} is a body; constraints and forces come and go.")
    if getattr(item, "adds_inertia", False):
        raise InvalidArgument(f"{item.name} has inertia, which can't come and go: couple a body by a constraint.")
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
        if other is not item and any(value is item for value in other.referred)
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
    for body in (twin.ground, *twin._bodies):
        vars(body)["scene"] = twin  # of the scene of a phase, too
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


# `scene.parameters` and `scene.with_parameters`: scenes with other numbers, which share their analysis.
#
# A scene with other parameters is packed numbers at first. It makes bodies, constraints and forces of its own when
# these are asked for; a run needs none of them.

_making = threading.RLock()  # handles are made by one thread at a time: their aliases are shared
HANDLES = ("ground", "_bodies", "_added", "_forces", "_normalisations")  # attributes of a scene


def parameters(scene: Scene) -> ParameterList:
    """Return what may vary from run to run: numbers of bodies, constraints and forces, by name, with units.

    Returns
    -------
    ParameterList
        A mapping of names, "object.attribute", to values; `.units` has their units. Masses, inertias, points, axes,
        lengths, stiffnesses, loads, starts and so on, those of plug-ins included, and "gravity". Of a scene of a TOML
        file first the numbers of its table `parameters`, by their own names, of which other values follow.

    Notes
    -----
    Give every part a name of its own: a name that stands for several is left out.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.5, position=(1, 0, 0), name="bob")
    >>> spring = scene.add(ts.forces.Spring(bob, scene.ground, stiffness=80.0, name="spring"))
    >>> scene.parameters()["spring.stiffness"], scene.parameters().units["spring.stiffness"]
    (80.0, 'N/m')
    """
    from .parameters import ParameterList, fields_of

    fields = {name: field for name, field in fields_of(scene).items() if field.is_numeric}
    values = {name: field.value for name, field in fields.items()}
    return ParameterList(values, {name: field.unit for name, field in fields.items()})


@fitting
def with_parameters(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """Return a scene with other values of some parameters; this scene is not changed.

    Parameters
    ----------
    values : mapping
        Values by name, as `parameters()` lists them; checked as the attributes are when they are set. Values that were
        derived from others when the scene was built, such as the free length of a spring, remain as they are. With a
        number of the table `parameters` of a file the scene is as if the file had been edited: all that follows from
        the number changes; what has been set after the file was read is set again.

    Returns
    -------
    Scene
        Independent of this scene; handles of this scene serve for its solutions, too. A run of it has the bits of a
        scene that is built with these values.

    Raises
    ------
    InvalidArgument
        If there is no such parameter; for a number of a file, if the scene has other parts than the file, or the file
        has mistakes with it.
    TsdynError
        If a value is inadmissible.

    Notes
    -----
    The constraint graph and the packed arrays are shared: masses, inertias, starts, gravity, and the numbers of forces
    and of constraints such as Distance take tens of microseconds, the geometry of a joint some hundreds. Functions of
    time, sampling periods, joints that a force refers to, and numbers of a file take milliseconds: the scene is packed
    again.

    Examples
    --------
    >>> import tsdyn as ts
    >>> scene = ts.Scene(gravity=(0, 0, -10))
    >>> bob = scene.add_point_mass(mass=1.0, position=(0, 0, -1), name="bob")
    >>> spring = scene.add(ts.forces.Spring(bob, scene.ground, stiffness=80.0, name="spring"))
    >>> stiff = scene.with_parameters({"spring.stiffness": 200.0, "bob.velocity": (0, 0, 1)})
    >>> print(stiff["spring"].stiffness, spring.stiffness)
    200.0 80.0
    >>> print(ts.simulate(stiff, (0, 0.1)).position(bob)[-1].round(4))
    [ 0.      0.     -0.9724]
    """
    if not isinstance(values, Mapping):
        raise InvalidArgument(
            f"values must be a mapping of names to values, such as {{'bob.mass': 2.0}}, got {values!r}."
        )
    family, changes = family_of(scene)
    changes = {**changes, **values}
    found = None if contacts_of(scene._added) else family.numbers(changes)  # phases have rows of the scene's own
    return packed_anew(family, changes) if found is None else of_numbers(scene, family, changes, *found)


def family_of(scene):
    """The `Family` of a scene as it is now, and by which values the scene differs from its template."""
    from .parameters import Family

    kept = prepared_numbers(scene)
    known = kept.packed.derived
    if known.family is None:
        _ = kept.refusal, kept.pays, kept.sharp, kept.slips, kept.sampled  # for `Prepared.like`
        known.family = Family(kept.packed, scene._initial(), scene.copy()), {}, kept
    return known.family[:2]


def of_numbers(scene, family, changes, packed, start):
    """Return a scene of these packed numbers, which makes its handles later."""
    kept = scene._prepared
    packed.derived.family = family, changes, kept
    other = object.__new__(type(scene))
    vars(other).update(
        _gravity=packed.system.gravity.copy(), _packed=packed, _start=start, _prepared=kept.like(packed),
        _users=scene._users, _functions=scene._functions, _waiting={}, _titles=None, _names=None, _twins=None,
        _aliases=None, _opens=False, _later=(family, changes),
        **{name: vars(scene)[name] for name in ("imported", "_drawn", "_named") if name in vars(scene)},
    )  # fmt: skip
    other._gravity.setflags(write=False)
    return other


def place(scene: Scene, q: Floats, qd: Floats) -> None:
    """Make q (n,) and qd (n,) the initial values of the bodies."""
    if "_later" in vars(scene):
        (family, changes), values, known = scene._later, _start_values(scene._packed, q, qd), scene._packed.derived
        changes = {**changes, **values}
        if known.is_of_start:
            vars(scene).update(vars(of_numbers(scene, family, changes, *family.numbers(changes))))
            return
        known.family = family, changes, scene._prepared
        vars(scene).update(_start=family.numbers(values)[1], _later=(family, changes))
        return
    for body, (at, length) in zip(scene._bodies, scene.system.bodies.tolist(), strict=True):
        body.place(q[at : at + length], qd[at : at + length])


def _start_values(packed, q, qd):
    """The parameters of a start q (n,), qd (n,), by name."""
    found = {}
    for body, (at, length) in zip(packed.bodies, packed.system.bodies.tolist(), strict=True):
        values = body.values_at(q[at : at + length], qd[at : at + length])
        found |= {f"{body.name}.{name}": value for name, value in values.items()}
    return found


def start_of(scene):
    """The parameters of the start by name, with the bits that were given; other changes of the scene beside them."""
    if "_later" in vars(scene):
        return scene._later[1]
    return {f"{body.name}.{name}": body.values[name] for body in scene._bodies for name in START if name in body.values}


def start_names(packed):
    """The names of these parameters."""
    return {f"{body.name}.{name}" for body in packed.bodies for name in START if name in body.values}


def packed_anew(family, changes):
    """Return a scene with other values, and handles of its own."""
    with _making:
        scene, pairs = _made(family, changes)
    scene._twins = scene._aliases = WeakKeyDictionary(pairs)
    packed, before = scene.packed, family.packed
    same = classes(packed) == classes(before) and packed.system.segments.shape == before.system.segments.shape
    if same and (packed.system.segments == before.system.segments).all():
        packed.derived.shared = family.shared
    return scene


def make_handles(scene):
    """Make bodies, constraints and forces of a scene that is packed numbers so far."""
    with _making:
        if "_later" not in vars(scene):  # another thread has made them
            return
        family, changes = scene._later
        twin, pairs = _made(family, changes)
        for body in (twin.ground, *twin._bodies):
            vars(body)["scene"] = scene
        scene._twins = scene._aliases = WeakKeyDictionary(pairs)
        handles = handles_of(scene._packed)
        handles.add_aliases([(own, handles.own(known)) for known, own in pairs])
        vars(scene).update({name: vars(twin)[name] for name in HANDLES})
        del scene._later


def _made(family, changes):
    """Return a copy of the template with other values; pairs of each handle of the original and its counterpart."""
    template, packed = family.template, family.packed
    twin, others = family.copied(changes)
    refused = dict.fromkeys(others)
    while refused:  # values that are admissible together only, in any order
        tried, refused = refused, {}
        for name in tried:
            field = family.field(name)
            owner = twin if field.owner is template else twin[field.owner]
            try:
                setattr(owner, field.attribute, field.entered(others[name], getattr(owner, field.attribute)))
            except TsdynError as error:
                refused[name] = error
        if len(refused) == len(tried):
            raise next(iter(refused.values()))
    known = (*packed.bodies, *(member.constraint for member in packed.members), *(load.force for load in packed.loads))
    owners = (*template.bodies, *template.constraints, *template.forces)
    pairs = {one: twin[owner] for one, owner in zip(known, owners, strict=True)}
    aliases = [(one, pairs[meant]) for one, meant in handles_of(packed).aliases() if meant in pairs]
    return twin, [*pairs.items(), *aliases]
