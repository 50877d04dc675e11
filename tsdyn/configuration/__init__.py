"""Configurations at one instant: initial conditions, assembly, rank and redundancy, mobility, conflicts.

Imports taylor and below.

Begin with initial_conditions.py (a start is checked, projected, and its redundant rows are dropped;
start_violations.py refuses broken constraints, mirrored_branches.py opposed axes) and assemble.py (`scene.assemble`).
continuation.py leads from a sketch to the manifold, mobility.py counts degrees of freedom. row_dependence.py finds
redundant rows and the rows that they depend on; rank.py writes the message that names them.
"""
