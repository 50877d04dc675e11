"""Scratch memory of a run: every array is laid out once, before the first step.

Imports rows and below.

Begin with workspace.py, and run_state.py for what drivers, step kernels and interpolants share. tangent_memory.py
allocates what the basis-free form needs, chart_workspace.py what a chart does.
"""
