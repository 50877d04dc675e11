"""Rows of the tables of an `Expansion`, each a record; addresses are those of kernels of this process."""

from ..jit.kernels import Record


class ConstraintSeries(Record):
    """All instances of one class of primitive."""

    loop: int  # address of constraint_series.loop
    values: int  # where the series of the first begin in Expansion.constraints
    width: int  # floats of each


class ForceSeries(Record):
    """All instances of one kind of force."""

    loop: int  # address of force_series.loop
    values: int  # where the series of the first begin in Expansion.loads
    width: int  # floats of each
    count: int
    stride: int  # reals of each
    table: int  # where the entries of the first begin in Expansion.table
    reals: int  # and in System.reals
    check: int  # address of law_check.check; 0 where the law is not sharp
    run: int  # address of what runs the program of a traced function; 0 for none


class MotionSeries(Record):
    """A prescribed motion, or a number of a load."""

    run: int  # address of what runs its program
    program: int  # where the program begins in System.reals
    values: int  # where its series begins in Expansion.constraints or, of a load, in Expansion.loads
