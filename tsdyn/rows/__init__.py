"""The constraint rows at a configuration: evaluate, factorise, solve, without redundant rows.

Imports sparse and below. The rows themselves come from elements/loops/constraint_rows.py, Phi of each kind from
constraints/.

Begin with evaluation.py: H at the present poses, S = H W H^T and its factors. schur_complement.py forms the products
with H, independent_rows.py chooses which of redundant rows to keep, singularity.py says how near Phi_q is to losing
rank; tolerances.py has the share below which a pivot counts as zero (sparse/block_operations.py compares).
"""
