"""The Taylor integrator: series of the motion order by order, step length, projection, dense output.

Imports runs and below.

Begin with coefficients.py (the recurrences), then step_parts.py (the parts of a step as callbacks) and stepper.py (the
trials of a step, and the compiled driver). step_length.py has the radius of convergence and the choice of the order,
layout.py the memory and the parts of a scene without series; series_engine.py is driven by runs/driver.py.
lane_stepper.py makes a step of several cases at once.
"""
