"""The Taylor integrator: series of the motion order by order, step length, projection, dense output.

Imports runs and below.

Begin with coefficients.py (the recurrences), then step_parts.py (the parts of a step as callbacks) and stepper.py (the
compiled driver). step_length.py has the radius of convergence, layout.py the memory and which parts of a scene have
no series.
"""
