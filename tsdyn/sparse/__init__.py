"""Sparse symmetric factorisation of S = H W H^T: the graph of a scene, elimination order, dense blocks.

Imports model and below.

Begin with constraint_graph.py (which rows meet at which bodies; graph_builder.py makes it, constraint_graphs.py keeps
it), then symbolic.py (a fill-reducing order), panels.py (where every number goes) and factorisation.py (the numeric
factors and the solves), whose pivots are eliminated in block_operations.py; rows call it by elimination.py.
massless_axes.py adds a row for an axis about which a body has no inertia.
"""
