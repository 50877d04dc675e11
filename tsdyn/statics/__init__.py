"""Static equilibria; linearisation about a state, at rest or in motion, in minimal coordinates.

Imports configuration and below.

Begin with linearise.py (`scene.linearise`; motion.py has the motion, pairwise.py derivatives of constraints and forces,
variations.py rows of coordinates, reduction.py M, C and K) and equilibrium.py (`scene.equilibrium`): descent.py chooses
steps, moves.py takes them, rest.py has what acts, quadratic.py and signed_factors.py its stiffness. With a spin:
relative_equilibrium.py.
"""
