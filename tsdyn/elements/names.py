"""Lookup of bodies, constraints and forces by name or handle."""

from ..errors import InvalidArgument
from ..validation import close


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


def _some(names):
    shown = ", ".join(map(repr, names[:8])) or "none"
    return f"{shown} and {len(names) - 8} more" if len(names) > 8 else shown
