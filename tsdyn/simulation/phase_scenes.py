"""Scenes of the phases of a run: what of a scene stays, and what its contacts and frictions are in their modes."""

from copy import copy
from functools import partial, wraps
from itertools import chain

import numpy as np

from ..calls import fitting
from ..elements.force import Force
from ..elements.unilateral import contacts_of
from ..errors import InconsistentState, InvalidArgument
from ..formulations.locked_orientations import still
from ..model.handles import begins_of, handles_of
from ..model.packed import pack
from ..rows.constraint_graph import arms, parts_of
from ..rows.inertia_rows import levers
from ..validation import listed
from .tolerances import KEPT_COORDINATES, LEAST_PHASES

# A phase is a scene of its own, packed once for each combination of contacts: the bodies, joints and forces of the
# scene, less those that are switched off, and the rows that its units add in their modes, such as that of a closed gap.
# So nothing below it knows of contacts, and a scene without contacts loads nothing of this. Numbers of these rows that
# are taken at a transition, such as the place where a block sticks, are among what the run remembers: nothing is packed
# for other values, nor for frictions of joints that stick or slide. As many contacts between the same bodies, at other
# points, are the same phase with other numbers: of it they take over the constraint graph and memory. All phases
# remember the same: angles of all joints, and what all forces and constraints of the scene remember, whether these are
# active or not.

NAMED = 5  # contacts in a message
SHARED = "holds", "places", "members", "short_rows", "start_workspaces", "reactions"  # of `Derived`: by such phases


def has_contacts(scene):
    """Whether runs of a scene have phases, by contacts, exact friction or inactive parts; kept until it changes."""
    if scene._opens is None:
        slides = any(getattr(force, "slides", ()) for force in scene._forces)
        scene._opens = slides or bool(contacts_of(scene._added) or inactive_of(scene))
    return scene._opens


def inactive_of(scene):
    """The constraints and forces that are inactive at the start, a tuple."""
    return tuple(each for each in (*scene._added, *scene._forces) if not each.active)


def with_own_parts(scene):
    """Pack a scene of `with_parameters` again if it is packed with the parts of another: phases take its own."""
    if scene._bodies and scene.packed.bodies[0] is not scene._bodies[0]:
        scene.touch()


def dependent(scene, items):
    """These items, and friction by reactions of joints among them: a tuple."""
    gone = {id(item) for item in items}
    frictions = [force for force in scene._forces if "normal_load" in force.kernels and id(force) not in gone]
    return *items, *(force for force in frictions if id(force.joint) in gone)


def phase_of(scene, rows, holds=(), without=None, every=()):
    """The scene with these rows, primitives, and forces in place of its contacts.

    Kept until the scene changes, or until phases have become so many that their memory is let go of.

    holds: rows with numbers that the run remembers, as `frictions.Hold`. without: constraints and forces left
    out, by default those that are inactive at the start. every: all that may hold; the phase is packed with their rows,
    and of those that don't hold the run remembers zeros.
    """
    known = scene._phases
    if known is None:
        known = scene._phases = {}
    without = dependent(scene, inactive_of(scene)) if without is None else without
    packed = every or holds  # whose rows are
    key = frozenset(map(id, rows)), frozenset(map(id, without)), frozenset(hold.key for hold in packed), bool(every)
    phase = known.get(key)
    if phase is None:
        if len(known) >= max(LEAST_PHASES, KEPT_COORDINATES // (7 * len(scene._bodies))):
            _let_go(known)
        gone = {id(each) for each in (*contacts_of(scene._added), *without)}
        constraints, forces = ([each for each in rows if isinstance(each, Force) is given] for given in (False, True))
        held = [hold.rows() for hold in packed]
        phase = known[key] = object.__new__(type(scene))
        vars(phase).update(vars(scene))
        vars(phase).update(
            _added=[each for each in scene._added if id(each) not in gone] + [*constraints, *chain(*held)],
            _forces=[each for each in scene._forces if id(each) not in gone] + forces, _packed=None,
            _start=scene._initial(), _prepared=None, _phases=None, _gaps=None, _spare={}, _waiting={}, _opens=False,
            _pack=partial(_pack_phase, phase, scene, packed, held), _whole=scene,
        )  # fmt: skip
        if not (packed or forces):
            like = vars(phase)["_like"] = key[1], [(type(row), id(row.a), id(row.b)) for row in rows]
            first = next(each for each in known.values() if vars(each).get("_like") == like)
            if first is not phase and _takes_over(phase.packed, first.packed):
                phase._base = first
    return _with_rows_held(phase, holds) if every else phase


def _takes_over(packed, first):
    """Whether phases differ in numbers alone, as of corners of the same boxes; then one takes over what has none.

    These are the graph, series and memory. Not where starts have found out more of the rows.
    """
    known, own = first.derived, packed.derived
    if known.redundant is not None or known.turning or len(still(first).bodies) or packed.size != first.size:
        return False
    names = [name for name in packed.system._fields if name != "reals"]
    arrays = [[getattr(each.system, name) for name in names] for each in (packed, first)]
    if packed.parameters != first.parameters or not all(map(_are_same, *arrays)):
        return False
    own.graph, own.graphs = parts_of(first), known.graphs
    own.start_workspaces, own.reactions = known.start_workspaces, known.reactions
    return True


def _are_same(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


def _let_go(known):
    """Forget phases; what solutions have of them is packed numbers, without the memory of runs."""
    for phase in known.values():
        if phase._packed is not None:
            kept = phase._packed.derived
            kept.start_workspaces, kept.row_parts, kept.reactions, kept.engines = [], [], {}, {}
    known.clear()


def _with_rows_held(base, holds):
    """The phase `base` with the rows of these holds alone; kept as long.

    The other rows are zero, and redundant. What doesn't depend on which rows hold is shared by these phases: arrays,
    elimination, series, and the memory of runs.
    """
    known, ranks, whole = base._phases, dict(hold.key for hold in holds), base.packed.derived
    if known is None:
        whole.redundant, whole.switched = np.zeros(0, np.int64), np.concatenate([*whole.holds.values()])
        base._base, known = base, {}
        base._phases = known
    key = frozenset(ranks.items())
    if key not in known:
        graph, kinds = parts_of(base.packed)
        off = np.concatenate([rows[ranks.get(slot, 0) :] for slot, rows in whole.holds.items()])
        own = copy(whole)
        for name in SHARED:
            setattr(own, name, getattr(whole, name))
        own.redundant, own.locked = np.flatnonzero(np.isin(graph.row, off)), still(base.packed)._replace(redundant=off)
        own.graph = graph._replace(dropped=own.redundant), kinds
        phase = known[key] = object.__new__(type(base))
        vars(phase).update(vars(base), _packed=base.packed._replace(derived=own), _prepared=None, _phases=None)
    return known[key]


def _pack_phase(phase, scene, holds, held):
    """Pack a phase of a scene: it remembers what the scene does, in the same order."""
    whole = scene.packed
    packed = pack(phase, handles_of(whole).where_some_act((*phase._added, *phase._forces)), whole)
    known = whole.derived
    packed.derived.masks, packed.derived.levers, packed.derived.arms = known.masks, levers(whole), arms(whole)
    if whole.system.memory.size:
        packed = _remembering(packed, whole)
    return _holding(packed, holds, held) if holds or packed.contacts else packed


def _remembering(packed, whole):
    """Packed with the memory of a whole scene; what is missing is kept in numbers that nothing reads."""
    own, size = _slots(packed), whole.system.memory.size
    memory = packed.system.reals.size + np.arange(size)
    found = _slots(whole)
    for item, slots in own.items():
        memory[found[item]] = packed.system.memory[slots]
    if np.array_equal(memory, packed.system.memory):
        return packed._replace(contacts=whole.contacts)
    first = {item: slots.start for item, slots in found.items()}
    pairs = zip(packed.constraints, packed.slots, strict=True)
    return packed._replace(
        system=packed.system._replace(memory=memory, reals=np.append(packed.system.reals, np.zeros(size))),
        loads=tuple(load if load.slot < 0 else load._replace(slot=first[_owner(load.force)]) for load in packed.loads),
        slots=tuple(slot if slot < 0 else first[id(part)] for part, slot in pairs),
        contacts=whole.contacts,
    )


def _owner(force):
    """The id of the force whose memory it is: friction of a contact, by its own reaction or as it shares those."""
    return id(getattr(force, "of", force))


def _slots(packed):
    """The slots of System.memory of each force and primitive that has any, a slice, by its id."""
    owners = [(load.slot, _owner(load.force)) for load in packed.loads]
    owners += zip(packed.slots, map(id, packed.constraints), strict=True)
    owners += ((slot, id(contact)) for contact, slot in packed.contacts)
    owners = sorted(owner for owner in owners if owner[0] >= 0)
    ends = [*(slot for slot, _ in owners[1:]), packed.system.memory.size]
    found = {item: slice(slot, end) for (slot, item), end in zip(owners, ends, strict=False)}
    laws = [(slot, contact.sides[0].grip.sliding) for contact, slot in packed.contacts]
    return found | {id(law): slice(slot, slot + law.taken) for slot, law in laws}


def gaps_of(scene, without=None, holds=()):
    """The `Gaps` of a scene, of its inactive contacts too, kept until it changes; the others as of `phase_of`."""
    free = phase_of(scene, [], holds, without)
    if free._gaps is None:
        free._gaps = _new_gaps(scene, free)
    free._gaps.workspace.begin()
    return free._gaps


def _new_gaps(scene, free):
    from ..analyses.contact_problem import Gap, Gaps

    first = first_row_of(scene.packed)
    gaps = [
        Gap(contact, side, first[id(contact)] + i, tuple(contact.parts))
        for contact in contacts_of(scene._added)
        for i, side in enumerate(contact.sides)
    ]
    rows = [gap.side.gap for gap in gaps]
    slips = [part for gap in gaps if gap.side.grip for part in gap.parts]
    rows += [part for part in slips if not any(part is row for row in rows)]
    alone = phase_of(scene, rows, without=(*scene._added, *scene._forces))
    return Gaps(scene.packed, alone.packed, free.packed, gaps)


def _holding(packed, holds, held):
    """Packed with the numbers of the rows that hold frictions and contacts among what the run remembers."""
    system, begins, first = packed.system, begins_of(packed), first_row_of(packed)
    memory, places = system.memory.copy(), packed.derived.places
    index = {id(part): i for i, part in enumerate(packed.constraints)}
    for hold, rows in zip(holds, held, strict=True):
        packed.derived.holds[hold.unit.slot] = np.array([first[id(row)] for row in rows], int)
        places.update(zip([index[id(row)] for row in rows], hold.places(), strict=True))
    for contact, slot in packed.contacts:
        for k, part in enumerate(contact.parts[1:], 1):
            if id(part) in index:
                places[index[id(part)]] = [(slot + 3 * k + i, 3 + i) for i in range(3)]  # the point of b
    for i, numbers in places.items():
        for slot, at in numbers:
            memory[slot] = begins[id(packed.constraints[i])] + at
    return packed._replace(system=system._replace(memory=memory))


def first_row_of(packed):
    """The first row of each constraint, by its id."""
    return {id(member.constraint): member.rows.start for member in packed.members}


def at_start(scene):
    """The scene at its start: closed contacts hold, without friction; ratchets and inactive parts are left out."""
    if not has_contacts(scene):
        return scene
    from ..analyses.contact_problem import closed_gaps

    gaps, (q, _) = gaps_of(scene), scene.start
    angles = handles_of(scene.packed).angles_at_start(0.0, q)
    closed = [gaps.list[i] for i in closed_gaps(gaps, q, angles) if i not in gaps.following]
    sides = [gap.side for gap in closed if gap.contact.active]
    return phase_of(scene, [side.gap for side in sides])


def demand_bilateral(scene):
    """Raise InvalidArgument where a scene has contacts or exact friction."""
    if not has_contacts(scene):
        return
    exact = [force for force in scene._forces if getattr(force, "slides", ())]
    if exact:
        raise InvalidArgument(
            f"this analysis doesn't serve friction of the exact law, which sticks and slides: {named(exact)}. Give "
            "slip_velocity (slip_rate of a torque), such as 1e-3 m/s, for the regularised law."
        )
    raise InvalidArgument(
        f"this analysis is of one phase of a run, along which {named(contacts_of(scene._added))} may open and close. "
        "In a copy of the scene, hold those that are closed by unilateral=False, and remove the others."
    )


def named(items):
    """Names of contacts, in a message."""
    return listed(list(dict.fromkeys(item.name for item in items)), NAMED)


def with_closed_contacts(function):
    """Decorate a method of scenes: contacts that are closed at the start hold, the others are left out."""
    own = getattr(function, "__wrapped__", function)

    @wraps(function)
    def call(scene, *arguments, **keywords):
        return own(at_start(scene), *arguments, **keywords)

    return fitting(call)


def with_closed_or_open_contacts(function):
    """Decorate `set`: as `with_closed_contacts`, and where closed contacts don't allow it they are left out, too."""
    own = getattr(function, "__wrapped__", function)

    @wraps(function)
    def call(scene, *arguments, **keywords):
        try:
            return own(at_start(scene), *arguments, **keywords)
        except InconsistentState:
            if not has_contacts(scene):
                raise
        return own(phase_of(scene, []), *arguments, **keywords)

    return fitting(call)
