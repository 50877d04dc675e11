"""Scenes of the phases of a run: the scene with some of its unilateral constraints closed, the others left out."""

from functools import wraps

from ..calls import fitting
from ..elements.unilateral import contacts_of
from ..errors import InvalidArgument
from ..model.handles import handles_of
from ..validation import listed

# A phase is a scene of its own, packed once for each set of closed gaps, on the bodies, joints and forces of the scene.
# So nothing below it knows of contacts, and a scene without contacts loads nothing of this.

NAMED = 5  # contacts in a message


def has_contacts(scene):
    """Whether a scene has unilateral constraints; looked up once until the scene changes."""
    if scene._opens is None:
        scene._opens = bool(contacts_of(scene._added))
    return scene._opens


def phase_of(scene, rows):
    """The scene with these rows of its contacts, primitives, for all of them; kept until the scene changes."""
    known = scene._phases
    if known is None:
        known = scene._phases = {}
    key = frozenset(map(id, rows))
    if key not in known:
        contacts = contacts_of(scene._added)
        others = [each for each in scene._added if not any(each is contact for contact in contacts)]
        phase = known[key] = object.__new__(type(scene))
        vars(phase).update(vars(scene))
        vars(phase).update(
            _added=others + list(rows), _packed=None, _start=None, _prepared=None, _phases=None, _spare={}, _waiting={},
            _opens=False,
        )  # fmt: skip
    return known[key]


def at_start(scene):
    """The scene with those contacts closed that are so at its start; a scene without contacts as it is."""
    if not has_contacts(scene):
        return scene
    from ..analyses.contact_problem import Gaps, closed_gaps

    gaps, (q, _) = Gaps(scene.packed), scene.start
    angles = handles_of(scene.packed).angles_at_start(0.0, q)
    return phase_of(scene, [gaps.list[i].side.row for i in closed_gaps(gaps, q, angles)])


def demand_bilateral(scene, who="this analysis"):
    """Raise InvalidArgument where a scene has contacts."""
    if has_contacts(scene):
        names = listed([each.name for each in contacts_of(scene._added)], NAMED)
        raise InvalidArgument(
            f"{who} is of one phase of a run, along which {names} may open and close. In a copy of the scene, hold "
            "those that are closed by unilateral=False, and remove the others."
        )


def where_it_stands(function):
    """Decorate a method of scenes: contacts that are closed at the start hold, the others are left out."""
    own = getattr(function, "__wrapped__", function)

    @wraps(function)
    def call(scene, *arguments, **keywords):
        return own(at_start(scene), *arguments, **keywords)

    return fitting(call)
