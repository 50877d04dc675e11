"""Configurations at one instant: initial conditions, assembly, rank and redundancy, mobility, conflicts.

Imports taylor and below.

Begin with initial_conditions.py (a start is checked and projected; start_violations.py refuses those that break
constraints, mirrored_branches.py those with axes opposed) and assemble.py (`scene.assemble`). continuation.py leads
from a sketch to the manifold, mobility.py counts degrees of freedom, row_dependence.py names redundant rows.
"""
