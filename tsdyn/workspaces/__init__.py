"""Scratch memory of a run: every array is laid out once, before the first step.

Imports rows and below.

Begin with workspace.py: that of the forms with a basis, and the tuple of all that a formulation's kernels get.
chart_workspace.py is that of a chart; the workspace of the constraint rows is of package rows.
"""
