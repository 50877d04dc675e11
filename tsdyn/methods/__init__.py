"""Integration methods, coefficients aside: tableaus, step kernels, interpolants.

Imports workspaces and below. integrators/ is written on this package, a file a method.

Begin with integrator.py (what a method is), then explicit.py and diagonally_implicit.py (the kernels that make a
step; explicit.py serves those of plug-ins) and interpolants.py (polynomials within a step, in chart coordinates;
runs/dense_output.py puts them on the manifold).
"""
