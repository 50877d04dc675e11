"""Scratch memory of a run: every array is laid out once, before the first step.

Imports rows and below.

Begin with workspace.py: that of the forms with a basis, and the tuple of all that a formulation's kernels get.
run_state.py is what drivers, step kernels and interpolants share, chart_workspace.py the workspace of a chart; that of
the constraint rows is of package rows.
"""
