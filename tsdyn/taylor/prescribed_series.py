"""Taylor series of prescribed motions and of loads, for Taylor runs of driven scenes."""

from ..jit.kernels import kernel
from ..motions.program import call_smooth


@kernel
def _expand(system, x, rows, values):
    """The series of some motions, onto values."""
    for i in range(rows.shape[0]):
        row = rows[i]
        call_smooth(row.run, system.reals[row.program :], x.order.time, x.order.room, values[row.values :])


@kernel
def expand_motions(system, x):
    """The series of all motions and loads about the time of the expansion."""
    _expand(system, x, x.motions, x.constraints)
    _expand(system, x, x.drives, x.loads)
