"""Row evaluation: H at the current poses with redundant rows zeroed, and S = H W H^T."""

from typing import NamedTuple

import numpy as np

from ..elements.loops.constraint_rows import call_body_loop
from ..jit.kernels import ANY, DEBUG, callback, caller, image_of, kernel, loader, long_kernel, vector
from ..sparse.constraint_graph import N_COUNT, N_FIRST_INT, N_FIRST_REAL, N_REALS, REDUCED, Network, no_network
from ..sparse.factorisation import factor
from .axis_rows import clear_axes, leave_axes_out, multiply_axes, weigh_axes
from .independent_rows import WORSE, drop, drop_diagonal, drop_rows, select, weakest
from .schur_complement import multiply_rows, weigh_rows
from .tangent_workspace import UNHELD, WEAKEST, Free, no_free
from .tolerances import ZERO_PIVOT

HELD = 1e6  # times rounding: what dropped rows may be off by, as a start may


@kernel
def run_loops(network, reals, column, f, t, out, H):
    """One of the loops of constraint_rows.py, for every kind that has it; zeros for welds, axes and dropped rows."""
    for i in range(network.kinds.shape[0]):
        kind = network.kinds[i]
        if kind[column] != 0:
            call_body_loop(
                kind[column], kind[N_COUNT], kind[N_REALS], network.table[kind[N_FIRST_INT] :],
                reals[kind[N_FIRST_REAL] :], f.poses, f.poses, t, out, H,
            )  # fmt: skip
    for i in range(network.welds.shape[0]):
        out[network.welds[i, 0]] = 0.0
    clear_axes(network, out)
    if f.dropped[0] > 0:
        if column == REDUCED:
            _remember_unheld(f, out)
            drop_rows(f.dropped, H)
        drop(f.dropped, out)


@kernel
def _remember_unheld(f, Phi):
    """The largest |Phi| of the dropped rows."""
    worst = 0.0
    for i in range(f.dropped[0]):
        size = abs(Phi[f.dropped[1 + i]])
        if not size <= worst:
            worst = size
    f.sizes[UNHELD] = worst


@kernel
def serve_still(network, f, S):
    """Whether the rows that were chosen are about as independent as at best since then, by the factors of S."""
    if f.dropped[0] == 0:
        return True
    share = weakest(network, S)
    f.sizes[WEAKEST] = max(f.sizes[WEAKEST], share)  # a choice next to a singular configuration is no measure
    return share >= WORSE * f.sizes[WEAKEST]


@kernel
def held(f, floor):
    """Whether the dropped rows hold at a place on the manifold, by the last H taken there."""
    return f.dropped[0] == 0 or f.sizes[UNHELD] <= HELD * floor


@kernel
def factor_rows(network, f, H, Y, S, axes):
    """Y = W H^T and the factors of S = H W H^T, of H without the dropped rows; the row that fails, or -1.

    Without the `axes` W is that of the inertias given, which serves as a metric; accelerations need them.
    """
    weigh_rows(network, H, Y)
    multiply_rows(network, H, Y, S)
    drop_diagonal(network, f.dropped, S)
    if network.axes.rows.shape[0] > 0:
        weigh_axes(network, Y)
        if axes:
            multiply_axes(network, H, Y, S)
        else:
            leave_axes_out(network, S)
    return factor(network.pattern, S, ZERO_PIVOT)


class Choice(NamedTuple):
    """What `choose_anew` gets by one address."""

    network: Network
    free: Free


def choosing_anew(network, free):
    """The `Free` of a network with which kernels can choose rows anew."""
    if DEBUG:
        free.anew[0] = 1
        return free
    words = len(image_of(Choice(network, free)))
    whole = np.zeros(words + 2, np.int64)  # what the view `anew` keeps alive
    free = free._replace(anew=whole[words:])
    whole[:words] = image_of(Choice(network, free))
    free.anew[0], free.anew[1] = choose_anew.address, whole.ctypes.data
    return free


load_choice = loader(Choice(no_network(), no_free()))
CHOOSE = "ppdppppi"
call_choose = caller(CHOOSE)


@kernel
def _choose(network, f, reals, t, b, H, Y, S, axes):
    """Choose others to drop, with b, H, Y = W H^T and the factors of S of the new choice; whether there are any."""
    count = f.dropped[0]
    f.dropped[0] = 0
    run_loops(network, reals, REDUCED, f, t, b, H)
    found = select(network, f, H, Y, S, count, ZERO_PIVOT)
    f.dropped[0] = count
    drop_rows(f.dropped, H)
    drop(f.dropped, b)
    regular = factor_rows(network, f, H, Y, S, axes) < 0
    if found and regular:
        f.sizes[WEAKEST] = weakest(network, S)
    return regular


@callback(CHOOSE)
def choose_anew(choice, reals, t, b, H, Y, S, axes):
    """`_choose` by address: few scenes have redundant rows, and it is as long as all the rest. 1 or 0."""
    c = load_choice(choice)
    network, f = c.network, c.free
    m, size = network.row.size, network.pattern.shape[2]
    reals, b, H, Y, S = vector(reals, ANY), vector(b, m), vector(H, 16 * m), vector(Y, 16 * m), vector(S, size)
    return 1 if _choose(network, f, reals, t, b, H, Y, S, axes) else 0


if DEBUG:
    _choose_by_address = _choose
else:

    @kernel
    def _choose_by_address(network, f, reals, t, b, H, Y, S, axes):
        return call_choose(f.anew[0], f.anew[1], reals, t, b, H, Y, S, axes) != 0


@long_kernel
def factorise_rows(network, reals, f, t, b, H, Y, S, axes):
    """Y = W H^T and the factors of S of the present H; of redundant rows others are chosen where these serve no more.

    Whether there are any. Then b and H are those of the new choice. `axes` (0 or 1) as in `factor_rows`.
    """
    regular = factor_rows(network, f, H, Y, S, axes) < 0
    if f.dropped[0] == 0 or f.anew[0] == 0 or (regular and serve_still(network, f, S)):
        return regular  # rows may be left out for a moment of a scene that has no redundant ones
    return _choose_by_address(network, f, reals, t, b, H, Y, S, axes)
