"""Mathematics without mechanics: Euler parameters, vectors, dense linear algebra, power series, root isolation.

Imports jit. Most modules are independent of each other.

Begin with euler_parameters.py: A(p), G(p) and their derivatives. recurrences.py has the recurrences of
Taylor coefficients; power_series.py and two_jets.py are numbers that propagate a series through any formula.
"""
