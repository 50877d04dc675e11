"""Stops of a Taylor run: continuation after a step that ends at a stop."""

from ..errors import Status
from ..jit.kernels import kernel, long_kernel
from ..maths.dense_linalg import is_finite
from ..runs.breakpoints import amend, take_pieces
from ..runs.outputs import store_now
from .step_parts import call_expand, call_reach

NOT_FINITE = int(Status.NOT_FINITE)


@long_kernel
def cross_stop(context, c, r, log):
    """At a stop: poses and accelerations after it, for its output and the next series. Status."""
    w = c.work
    # Functions switch to their next piece; the state is the same, the accelerations are not
    take_pieces(c.system, r, log)
    status = call_reach(r.kernels.reach, context, r.clock.t, -1.0)
    if status == 0:
        status = call_expand(r.kernels.expand, context, 0, 1)
        if status != 0:
            return status
        if not is_finite(w.qdd):
            return NOT_FINITE
        store_now(w, r)
        amend(r, log, w.q, w.qd, w.qdd)
    return status


@kernel
def lower_order(order, rho, tol, h):
    """After a step cut to h: one order less for the next, where two less would have reached as far.

    rho is the radius of convergence as the coefficients up to that order have it.
    """
    # At order top - 2 the step would be rho tol^(1 / top)
    top = order.top
    if top > order.lowest and rho * tol ** (1.0 / top) > h:
        order.next = top - 1
