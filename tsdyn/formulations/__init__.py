"""The equations of motion in each form: tangent-space without and with a basis, Maggi/Kane; charts and projection.

Imports methods and below.

Begin with registry.py (the forms, as addresses of kernels), then tangent.py (O(N), the default) and null_space.py
(Haug's Eq. 26). projection.py projects positions and velocities onto the constraint manifold. chart_coordinates.py
has the retraction of a chart, chart_validity.py its criteria; friction_solve.py couples friction and reactions.
"""
