"""Integration methods, coefficients aside: tableaus, step kernels, interpolants.

Imports workspaces and below. integrators/ is written on this package, a file a method.

Begin with integrator.py (the interface of a method), then explicit.py and diagonally_implicit.py (step kernels) and
interpolants.py (dense output within a step, in chart coordinates).
"""
