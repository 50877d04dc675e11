"""Step kernels of plug-ins, written to the documented interface: docs/plug-ins.md.

A plug-in's step kernel has its arrays as arguments, not the `Run`. `plug_in_step` is what the driver
calls in its place.
"""

from ..jit.kernels import callback, caller
from ..workspaces.run_state import load_run
from .explicit import STEP

PLUG_IN_STEP = "piiddiipppppppp"
_call = caller(PLUG_IN_STEP)


def step_kernel(function):
    """Decorate a step kernel: f(context, place, accelerate, t, h, nx, ny, x, y, yd, xd, tableau, memory, dx, dy).

    It writes the increments dx, dy and returns 0, or the status that `call_place` or `call_accelerate` gave. Arrays
    come as addresses, integers: `vector(x, nx)` is the array of nx floats there, without a copy. x, xd and dx have nx
    floats, y, yd and dy have ny; lengths are not checked.
    """
    return callback(PLUG_IN_STEP)(function)


@callback(STEP)
def plug_in_step(context, run, t, h):
    """One step by the kernel of a plug-in. Status."""
    r = load_run(run)
    return _call(
        r.kernels.plug_in, context, r.kernels.place, r.kernels.accelerate, t, h, r.x.size, r.y.size,
        r.x, r.y, r.yd, r.xd, r.tableau, r.memory, r.dx, r.dy,
    )  # fmt: skip


def called_for(step):
    """The step kernel that the driver calls for a method's, and the one of a plug-in behind it, or None."""
    return (plug_in_step, step) if step.signature == PLUG_IN_STEP else (step, None)
