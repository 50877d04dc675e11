"""Compiled loops over all instances of one kind of constraint or force.

Imports jit, maths and markers. Every kind compiles its own copies, which the solver calls by address.

Begin with constraint_rows.py: the numbers that describe a body's pose, then rows of [Phi_r, Phi_pi'], Phi and gamma.
constraint_series.py and force_series.py give Taylor coefficients, constraint_hessians.py second derivatives for
implicit methods.
"""
