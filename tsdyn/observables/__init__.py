"""Quantities derived from t, q, qd, qdd: positions, energy, momentum, constraint errors, multipliers, reactions.

Imports formulations and below. States and solutions share it.

Begin with state.py (motion of bodies, points and joints). diagnostics.py recomputes errors, energy and momentum in
plain NumPy. reactions.py has multipliers and constraint forces, and whether they are unique. channels.py has all these
by name. evaluate.py gives all matrices at one state.
"""
