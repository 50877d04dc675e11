"""Scenes of the phases of a run: what of a scene stays, and what its contacts and frictions are in their modes."""

from functools import wraps
from itertools import chain

import numpy as np

from ..calls import fitting
from ..elements.force import Force
from ..elements.unilateral import contacts_of
from ..errors import InvalidArgument
from ..model.handles import handles_of
from ..model.packed import begins_of
from ..validation import listed

# A phase is a scene of its own, packed once for each combination of modes: the bodies, joints and forces of the scene,
# less those that are switched off, and the rows that its units add in their modes, such as that of a closed gap. So
# nothing below it knows of contacts, and a scene without contacts loads nothing of this. Numbers of these rows that are
# taken at a transition, such as the place where a block sticks, are among what the run remembers: nothing is packed
# for other values.

NAMED = 5  # contacts in a message


def has_contacts(scene):
    """Whether runs of a scene have phases, by contacts or exact friction; looked up once until the scene changes."""
    if scene._opens is None:
        scene._opens = bool(any(getattr(force, "slides", ()) for force in scene._forces) or contacts_of(scene._added))
    return scene._opens


def phase_of(scene, rows, holds=(), without=()):
    """The scene with these rows, primitives, and forces in place of its contacts; kept until the scene changes.

    holds: rows with numbers that the run remembers, as `friction_problem.Hold`. without: constraints and forces left
    out.
    """
    known = scene._phases
    if known is None:
        known = scene._phases = {}
    key = frozenset((*map(id, (*rows, *without)), *(hold.key for hold in holds)))
    if key not in known:
        gone = {id(each) for each in (*contacts_of(scene._added), *without)}
        constraints, forces = ([each for each in rows if isinstance(each, Force) is given] for given in (False, True))
        held = [hold.rows() for hold in holds]
        phase = object.__new__(type(scene))
        vars(phase).update(vars(scene))
        vars(phase).update(
            _added=[each for each in scene._added if id(each) not in gone] + [*constraints, *chain(*held)],
            _forces=[each for each in scene._forces if id(each) not in gone] + forces, _packed=None, _start=None,
            _prepared=None, _phases=None, _spare={}, _waiting={}, _opens=False,
        )  # fmt: skip
        if holds:
            phase._packed = _holding(phase.packed, holds, held)
        known[key] = phase
    return known[key]


def gaps_of(scene):
    """The `Gaps` of a scene with contacts."""
    from ..analyses.contact_problem import Gaps

    sides = [(contact, side) for contact in contacts_of(scene._added) for side in contact.sides]
    rows = [side.grip.gap if side.grip else side.row for _, side in sides]
    rubbing = [part for contact, side in sides if side.grip for part in contact.parts]
    rows += [part for part in rubbing if not any(part is row for row in rows)]
    alone = phase_of(scene, rows, without=(*scene._added, *scene._forces))
    return Gaps(scene.packed, alone.packed, phase_of(scene, []).packed)


def _holding(packed, holds, held):
    """Packed with the numbers of the rows of holds among what the run remembers."""
    system, begins, first = packed.system, begins_of(packed), first_row_of(packed)
    memory = system.memory.copy()
    for hold, rows in zip(holds, held, strict=True):
        packed.derived.holds[hold.unit.slot] = np.array([first[id(row)] for row in rows], int)
        for row, places in zip(rows, hold.places(), strict=True):
            packed.derived.places[id(row)] = places
            for slot, at in places:
                memory[slot] = begins[id(row)] + at
    return packed._replace(system=system._replace(memory=memory))


def first_row_of(packed):
    """The first row of each constraint, by its id."""
    return {id(member.constraint): member.rows.start for member in packed.members}


def at_start(scene):
    """The scene with those contacts closed, without friction, that are so at its start; without contacts as it is."""
    if not has_contacts(scene):
        return scene
    from ..analyses.contact_problem import closed_gaps

    gaps, (q, _) = gaps_of(scene), scene.start
    angles = handles_of(scene.packed).angles_at_start(0.0, q)
    closed = [gaps.list[i].side for i in closed_gaps(gaps, q, angles)]
    return phase_of(scene, [side.grip.gap if side.grip else side.row for side in closed])


def demand_bilateral(scene, who="this analysis"):
    """Raise InvalidArgument where a scene has contacts or exact friction."""
    if has_contacts(scene):
        demand_regular(scene, who)
        raise InvalidArgument(
            f"{who} is of one phase of a run, along which {named(contacts_of(scene._added))} may open and close. In a "
            "copy of the scene, hold those that are closed by unilateral=False, and remove the others."
        )


def named(items):
    """Names of contacts, in a message."""
    return listed(list(dict.fromkeys(item.name for item in items)), NAMED)


def demand_regular(scene, who):
    """Raise InvalidArgument where a scene has friction of the exact law."""
    exact = [force for force in scene._forces if getattr(force, "slides", ())]
    if exact:
        raise InvalidArgument(
            f"{who} doesn't serve friction of the exact law, which sticks and slides: {named(exact)}. Give "
            "slip_velocity (slip_rate of a torque), such as 1e-3 m/s, for the regularised law."
        )


def where_it_stands(function):
    """Decorate a method of scenes: contacts that are closed at the start hold, the others are left out."""
    own = getattr(function, "__wrapped__", function)

    @wraps(function)
    def call(scene, *arguments, **keywords):
        return own(at_start(scene), *arguments, **keywords)

    return fitting(call)
