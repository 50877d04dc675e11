"""Prescribed functions of time: their values, derivatives and Taylor series (`ts.motions`).

Imports jit and maths.

Begin with expressions.py: smooth motions such as `Sine` and `Polynomial`. prescribed.py makes a `Motion` of whatever
a driver is given, signals.py a load of time; tables.py and piecewise.py are data and splines, and program.py is what
the kernels evaluate.
"""

from .expressions import Constant, Exponential, Piecewise, Polynomial, Ramp, Sine, Smooth, time

__all__ = ["Constant", "Exponential", "Piecewise", "Polynomial", "Ramp", "Sine", "Smooth", "time"]


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
