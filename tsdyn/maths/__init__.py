"""Mathematics without mechanics: vectors, Euler parameters, dense linear algebra, power series, root isolation.

Imports jit. Most modules are independent of each other.

Begin with vectors.py: A(p), G(p) and their derivatives. recurrences.py has the recurrences of Taylor coefficients;
power_series.py has numbers that propagate a series through any formula.
"""
