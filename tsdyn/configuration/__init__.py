"""Configurations at one instant: initial conditions, assembly, rank and redundancy, mobility, contradictions.

Imports taylor and below.

Begin with initial_conditions.py (a start is checked and projected) and assemble.py (`scene.assemble`).
continuation.py leads from a sketch to the manifold, mobility.py counts degrees of freedom, row_dependence.py names
redundant rows.
"""
