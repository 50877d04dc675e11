"""Quantities derived from t, q, qd, qdd: positions, energy, momentum, constraint errors, multipliers, reactions.

Imports formulations and below. States and solutions share it.

Begin with kinematics.py (motion of bodies, points and joints) and state.py. diagnostics.py recomputes errors, energy
and momentum in plain NumPy. reactions.py has multipliers and constraint forces, friction_reactions.py the normal loads
of joint friction, uniqueness.py whether a reaction is unique. evaluate.py gives all matrices at one state.
"""
