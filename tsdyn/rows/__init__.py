"""The constraint rows at a configuration: evaluate, factorise, solve, without redundant rows; the constraint graph.

Imports model and below. The rows themselves come from elements/loops/constraint_rows.py, Phi of each kind from
constraints/.

Begin with interface.py, which other packages solve by; graphs and orders of elimination are open to all. evaluation.py
calls the loops, schur_complement.py forms S = H W H^T, N and products with H; row_selection.py selects the redundant
rows and renews the selection, redundant_rows.py zeroes them. constraint_graph.py makes the graph of a scene,
symbolic.py its order of elimination, factorisation.py eliminates.
"""
