"""Bookkeeping of the constraints and forces made for a scene: which were added, and under which names."""

import contextlib
import warnings
from contextvars import ContextVar

SHOWN = 5

_may_be_idle = ContextVar("whether forces that are made may be zero", default=False)


@contextlib.contextmanager
def idle_forces(admitted):
    """A block in which a force may be made whose numbers are all zero: a file says what it says."""
    token = _may_be_idle.set(admitted)
    try:
        yield
    finally:
        _may_be_idle.reset(token)


def note(item):
    """A constraint or force has been made: it waits to be added to its scene, or to become a part of a joint."""
    if "a" in vars(item):  # its __init__ has called that of its base
        if not _may_be_idle.get():
            item.demand_effect()
        item.scene._waiting[id(item)] = item


def stop_waiting(item):
    """It waits no longer."""
    item.scene._waiting.pop(id(item), None)


def warn_of_waiting(scene, stacklevel):
    """Warn, once, of what was made for a scene and never added."""
    if not scene._waiting:
        return
    titles = [item.title for item in scene._waiting.values()]
    scene._waiting.clear()
    more = f" and {len(titles) - SHOWN} more" if len(titles) > SHOWN else ""
    warnings.warn(
        f"made for this scene and never added: {', '.join(titles[:SHOWN])}{more}. What scene.add(...) isn't given has "
        "no effect.",
        stacklevel=stacklevel + 1,
    )


def admit(scene, item):
    """Give an item that is added a name of its own, or refuse the one that its user gave it and another has."""
    taken = scene._titles
    if taken is None:
        taken = scene._titles = {other.name for other in (*scene._added, *scene._forces)}
    if item.name in taken and item.named:
        raise item.error(f"the scene has a constraint or force named {item.name!r} already; choose another name.")
    name, count = item.name, 1
    while name in taken:
        name, count = f"{item.name} #{count + 1}", count + 1
    taken.add(name)
    if name != item.name:
        item.name = name
