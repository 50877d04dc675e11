"""Ctrl-C within a step of a large scene.

A driver calls the parts of a step by addresses in records of its run. Ctrl-C replaces these by kernels that do nothing
and return a Status with which the driver ends at once. The run is then put back to the end of its last slice, which is
the last step where steps are long. No kernel polls, so none of this costs anything in smaller scenes.
"""

from functools import partial

from ..errors import Status
from ..jit.interrupts import interruptible
from ..jit.kernels import callback
from ..methods.explicit import ACCELERATE, PLACE
from ..workspaces.carving import words

INTERRUPTED, PASSAGE = int(Status.INTERRUPTED), int(Status.PASSAGE)


@callback(PLACE)
def place_interrupted(context, t, x):
    """Stand-in of `place` and `linearise`."""
    return INTERRUPTED


@callback(ACCELERATE)
def accelerate(context, t, y, yd, xd):
    """In place of `accelerate`."""
    return INTERRUPTED


@callback("pdpppp")
def start_chart(context, t, x, y, yd, xd):
    """In place of `start_chart`."""
    return INTERRUPTED


@callback("pddppp")
def residual(context, t, g, x, y, k):
    """In place of `residual`, with which a stage begins and goes on."""
    return INTERRUPTED


@callback("pd")
def factorise(context, g):
    """In place of `reduce` and `factorise` of implicit methods."""
    return INTERRUPTED


@callback("pdpi")
def factorise_stages(context, h, tableau, i):
    """In place of `factorise_stages`."""
    return INTERRUPTED


@callback("pi")
def expand(context, k):
    """In place of `expand`."""
    return INTERRUPTED


@callback("pdd")
def reach(context, t, h):
    """In place of `reach`, `accelerate_here` and `pass_singular`: any other Status would let shorter steps be tried."""
    return PASSAGE


STAND_INS = {
    "place": place_interrupted, "accelerate": accelerate, "start_chart": start_chart, "reach": reach,
    "accelerate_here": reach, "pass_singular": reach, "expand": expand, "linearise": place_interrupted,
    "reduce": factorise, "factorise": factorise, "residual": residual, "factorise_stages": factorise_stages,
}  # fmt: skip


def call(kernel, arguments, called):
    """Return kernel(*arguments); Ctrl-C ends it between two calls by the addresses in the records `called`."""
    # Addresses that the driver calls, and their stand-ins
    places = [(record, name) for record in called for name in STAND_INS if getattr(record, name, 0)]
    addresses = [getattr(*place) for place in places]
    stand_ins = [STAND_INS[name].address for _, name in places]
    try:
        return interruptible(partial(kernel, *arguments), partial(_enter, places, stand_ins))
    except BaseException:
        _enter(places, addresses)
        raise


def _enter(places, addresses):
    for (record, name), address in zip(places, addresses, strict=True):
        setattr(record, name, address)


def advance(kernel, arguments, run, called):
    """`call` for some steps of a run: interrupted ones leave the run where it was before them."""
    # State at the end of the last slice
    parts = run.now, run.remembered, words(run.clock), words(run.numbers)
    before = [part.copy() for part in parts]
    try:
        return call(kernel, arguments, called)
    except BaseException:
        for part, kept in zip(parts, before, strict=True):
            part[...] = kept
        raise
