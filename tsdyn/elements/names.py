"""Lookup of bodies, constraints and forces by name or handle."""

from ..errors import InvalidArgument
from ..validation import close, shown


def named(things, name, what, error=InvalidArgument):
    """The one of some bodies, constraints or forces that has a name; `what` they are, in messages.

    Raises
    ------
    InvalidArgument, or `error`
        If none has it, or several have.
    """
    found = [thing for thing in things if thing.name == name]
    if len(found) == 1:
        return found[0]
    if found:
        raise error(
            f"{name!r} is the name of {len(found)}: {', '.join(map(repr, found))}; pass the handle itself, or give "
            "each a name of its own."
        )
    known = list(dict.fromkeys(thing.name for thing in things))
    near = close(name, known)
    there = f"did you mean {' or '.join(map(repr, near))}?" if near else f"there are {_some(known)}."
    raise error(f"no {what} is named {name!r}; {there}")


def new_name(value, thing, others, error):
    """Return a name that a thing may be given in its scene: text, which none of some others has; or raise `error`."""
    if not isinstance(value, str) or not value:
        raise error(f"{thing.name}: name must be text that is not empty, got {shown(value)}.")
    if any(other is not thing and other.name == value for other in others):
        raise error(f"{thing.name}: the scene has another named {value!r}; choose another name.")
    return value


def _some(names):
    shown = ", ".join(map(repr, names[:8])) or "none"
    return f"{shown} and {len(names) - 8} more" if len(names) > 8 else shown
