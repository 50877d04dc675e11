"""Static equilibria; linearisation about a state, at rest or in motion, in minimal coordinates.

Imports configuration and below.

Begin with linearise.py (`scene.linearise`) and equilibrium.py (`scene.equilibrium`, by the steps of descent.py; with a
spin by relative_equilibrium.py). motion.py has the motion that is linearised about, pairwise.py the derivatives of
constraints and forces, variations.py the rows that coordinates are made of, reduction.py M, C and K.
"""
