"""Prescribed functions of time: their values, derivatives and Taylor series (`ts.motions`).

Imports jit and maths.

Begin with elementary.py: smooth motions and their arithmetic, `Sine`, `Polynomial` and the like.
prescribed.py makes a `Motion` of whatever a driver is given, plain Python functions included, signals.py a load of
time; those of time and state are in elements/loads.py. tables.py has data and splines, knots.py says
where steps end, program.py is what kernels evaluate. tracing.py makes graphs of users' functions, and runs those of
time and state.
"""

from .elementary import Constant, Exponential, Piecewise, Polynomial, Ramp, Sine, Smooth, time

__all__ = ["Constant", "Exponential", "Piecewise", "Polynomial", "Ramp", "Sine", "Smooth", "time"]


def __dir__():
    """What users use, for completion."""
    return sorted(__all__)
