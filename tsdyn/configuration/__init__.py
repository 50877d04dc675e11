"""Configurations at one instant: initial conditions, assembly, rank and redundancy, mobility, conflicts.

Imports taylor and below.

Begin with initial_conditions.py (a start is checked, projected, and its redundant rows are dropped; motor_starts.py
refuses broken constraints and opposed axes) and assemble.py (`scene.assemble`). continuation.py leads from a sketch to
the manifold; joint_space.py closes loops from far away, along a spanning tree; mobility.py counts
degrees of freedom and names redundant rows with those that they depend on, and constraints that can't be met.
"""
