"""Analyses at one state or along a given motion: equilibria, linearisation, kinematics, inverse dynamics.

Minimal coordinates are chosen by the joints; equilibria are found by descent of the energy on the constraint manifold.
Imports `configuration` and what is below. Begin with `linearise` and `kinematic_analysis`.
"""
