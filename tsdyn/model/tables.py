"""Rows of the tables of a packed system, each a record: what runs over the instances of a kind, and where they are.

Addresses are those of kernels of this process; zero stands for none.
"""

from ..jit.kernels import Record


class ConstraintKind(Record):
    """All instances of one class of primitive."""

    phi: int  # addresses of the loops of coordinate_rows.py
    jacobian: int
    gamma: int
    phi_t: int
    remember: int
    curvature: int  # address of constraint_hessians.loop; implicit methods load it
    count: int  # instances
    stride: int  # reals of each
    table: int  # where the entries of the first begin in System.table
    reals: int  # and in System.reals


class ForceKind(Record):
    """All instances of one kind of force; user functions have kinds of their own."""

    force: int  # addresses of the loops of forces.py
    jacobian: int  # implicit methods load it
    remember: int
    count: int
    stride: int
    table: int
    reals: int
    kept: int  # where its derivatives begin among those that implicit methods keep


class MotionPlace(Record):
    """A prescribed motion: a program of `ts.motions`, or three functions of a user's."""

    value: int  # address of f, or of what runs a program
    rate: int  # address of fd; zero for a program
    acceleration: int  # address of fdd; zero for a program
    place: int  # where value, rate and acceleration at t are in System.reals
    program: int  # where the program begins there


class SignalPlace(Record):
    """A load that is a function of time."""

    address: int  # of the function, or of what runs a program
    place: int  # where its values at t are in System.reals
    width: int  # how many they are
    program: int  # where the program begins there; -1 for a function
