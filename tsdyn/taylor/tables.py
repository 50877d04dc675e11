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
    check: int  # address of law_check.check; 0 where the law is analytic everywhere
    margin: int  # address of law_check.margin; 0 for a law without a known margin of analyticity
    sharp: int  # whether every step is checked at all places
    near: int  # whether the step tried is, too
    run: int  # address of what runs the program of a traced function; 0 for none
    users: int  # whether the law is a user's, and may change within any part of a step


class FrictionSeries(Record):
    """A friction of a joint, in the order of ConstraintGraph.frictions."""

    slope: int  # address of friction.load_slope
    reaction: int  # where the series of its reaction begins in Expansion.loads: force and torque, one after the other
    point: int  # where the body-frame coordinates of the joint's point begin in System.reals
    first: int  # of its rows of Expansion.sources
    count: int


class ReactionSource(Record):
    """A marker of a joint, whose force is a part of the reaction that a friction depends on."""

    forces: int  # where the series of the force begins in Expansion.constraints
    coordinates: int  # where its body-frame coordinates begin in System.reals
    is_point: int  # 1 for a Point, 0 for a Vector
    body: int


class MotionSeries(Record):
    """A prescribed motion, or a number of a load."""

    run: int  # address of what runs its program
    program: int  # where the program begins in System.reals
    values: int  # where its series begins in Expansion.constraints or, of a load, in Expansion.loads
