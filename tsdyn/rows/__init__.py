"""The constraint rows at a configuration: evaluate, factorise, solve, redundant rows left out.

Imports sparse and below.

Begin with evaluation.py (H, S and its factors at the present poses). schur_complement.py forms S = H W H^T and the
products with H; selection.py finds independent rows and is where a pivot is judged zero; singularity.py says how near
Phi_q is to losing rank.
"""
