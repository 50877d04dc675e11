"""Mathematics without mechanics: Euler parameters, vectors, dense linear algebra, power series, root isolation.

Imports jit. Modules are independent of each other but for the pieces that they are made of.

Begin with euler_parameters.py: A(p), G(p) and their derivatives. recurrences.py has the coefficients of Taylor
series; power_series.py and two_jets.py are numbers that carry a series through any formula.
"""
