"""The equations of motion in each form: tangent-space without and with a basis, Maggi/Kane; charts and projection.

Imports methods and below.

Begin with registry.py (the forms, as addresses of kernels), then tangent.py (O(N), the default) and null_space.py
(Haug's Eq. 26). projection.py puts positions and velocities back on the constraint manifold; chart_coordinates.py and
chart_validity.py say where a chart leads and when it is left; friction_solve.py solves friction with its reactions.
"""
