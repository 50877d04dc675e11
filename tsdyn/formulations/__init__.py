"""The equations of motion in each form: tangent-space without and with a basis, Maggi/Kane; charts and projection.

Imports methods and below.

Begin with registry.py (the forms, as addresses of kernels), then tangent.py (O(N), without a basis, the default) and
null_space.py (Haug's Eq. 26; null_space_chart.py solves Eqs. 28 and 29). Both place the stages of a step in a chart:
charts.py has its coordinates and its validity. projection.py takes starts and ends of Taylor steps to the manifold,
accelerations.py solves for accelerations, multipliers and friction.
"""
