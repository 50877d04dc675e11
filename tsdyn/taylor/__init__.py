"""The Taylor integrator: series of the motion order by order, step length, projection, dense output.

Imports runs and below.

Begin with coefficients.py (the recurrences), then step_parts.py (the parts of a step as callbacks), stepper.py (the
compiled driver) and step_trials.py (what is tried for one step). step_length.py has the radius of
convergence and the choice of the order, layout.py the memory and which parts of a scene have no series;
series_engine.py is what runs/run.py drives.
"""
