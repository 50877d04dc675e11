"""The constraint rows at a configuration: evaluate, factorise, solve, without redundant rows.

Imports sparse and below.

Begin with evaluation.py (H, S and its factors at the present poses). schur_complement.py forms S = H W H^T and the
products with H; selection.py selects independent rows and judges where a pivot is zero; singularity.py has the
indicator of rank loss.
"""
