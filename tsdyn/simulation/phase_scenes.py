"""Scenes of the phases of a run: what of a scene stays, and what its contacts and frictions are in their modes."""

from functools import wraps
from typing import NamedTuple

from ..calls import fitting
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
    """Whether a scene has unilateral constraints; looked up once until the scene changes."""
    if scene._opens is None:
        scene._opens = bool(contacts_of(scene._added))
    return scene._opens


class Place(NamedTuple):
    """Where a number that the run remembers is among the numbers of a row."""

    slot: int  # of System.memory
    row: object  # a primitive of the phase
    at: int  # behind where its reals begin


def phase_of(scene, rows, places=(), without=()):
    """The scene with these rows, primitives, in place of its contacts; kept until the scene changes.

    places: `Place` of what the rows take from the memory of the run. without: constraints and forces left out.
    """
    known = scene._phases
    if known is None:
        known = scene._phases = {}
    key = frozenset(map(id, (*rows, *without)))
    if key not in known:
        gone = {id(each) for each in (*contacts_of(scene._added), *without)}
        phase = known[key] = object.__new__(type(scene))
        vars(phase).update(vars(scene))
        vars(phase).update(
            _added=[each for each in scene._added if id(each) not in gone] + list(rows),
            _forces=[each for each in scene._forces if id(each) not in gone],
            _packed=None, _start=None, _prepared=None, _phases=None, _spare={}, _waiting={}, _opens=False,
        )  # fmt: skip
        if places:
            phase._packed = _remembering(phase.packed, places)
    return known[key]


def last_phase(scene, phases):
    """The scene of the phase that a run has ended in."""
    packed = phases.packed[phases.of[-1]]
    return next(phase for phase in scene._phases.values() if phase.packed is packed)


def _remembering(packed, places):
    """Packed with the memory of these places in numbers of its rows."""
    system, begins = packed.system, begins_of(packed)
    memory = system.memory.copy()
    for slot, row, at in places:
        memory[slot] = begins[id(row)] + at
    return packed._replace(system=system._replace(memory=memory))


def at_start(scene):
    """The scene with those contacts closed that are so at its start; a scene without contacts as it is."""
    if not has_contacts(scene):
        return scene
    from ..analyses.contact_problem import Gaps, closed_gaps

    gaps, (q, _) = Gaps(scene.packed), scene.start
    angles = handles_of(scene.packed).angles_at_start(0.0, q)
    return phase_of(scene, [gaps.list[i].side.row for i in closed_gaps(gaps, q, angles)])


def demand_bilateral(scene):
    """Raise InvalidArgument where a scene has contacts: a run has phases then."""
    if has_contacts(scene):
        raise InvalidArgument(
            "a scene with unilateral constraints is run by ts.simulate: prepared runs, ensembles, benchmarks, profiles "
            "and analyses along a motion don't serve contacts yet."
        )


def where_it_stands(function):
    """Decorate a method of scenes: contacts that are closed at the start hold, the others are left out."""
    own = getattr(function, "__wrapped__", function)  # `fitting` names the method that is called

    @wraps(function)
    def call(scene, *arguments, **keywords):
        return own(at_start(scene), *arguments, **keywords)

    return fitting(call)


def without_contacts(function):
    """Decorate a method of scenes that takes constraints as bilateral: refuse scenes with contacts."""
    own = getattr(function, "__wrapped__", function)

    @wraps(function)
    def call(scene, *arguments, **keywords):
        if has_contacts(scene):
            names = listed([each.name for each in contacts_of(scene._added)], NAMED)
            raise InvalidArgument(
                f"{function.__name__} is for bilateral constraints, and {names} open{'s' * (',' not in names)}. Remove "
                "these from a copy of the scene, or hold them closed by unilateral=False."
            )
        return own(scene, *arguments, **keywords)

    return fitting(call)
