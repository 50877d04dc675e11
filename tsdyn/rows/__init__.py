"""The constraint rows at a configuration: evaluate, factorise, solve, without redundant rows.

Imports sparse and below. The rows themselves come from elements/loops/constraint_rows.py, Phi of each kind from
constraints/.

Begin with interface.py, the one module that other packages import. Below it evaluation.py calls the loops,
schur_complement.py forms S = H W H^T and products with H, chart_matrix.py N; independent_rows.py selects the redundant
rows, reselection.py renews the selection, redundant_rows.py zeroes them; tolerances.py has the thresholds.
"""
