"""The driver of step methods: attempt, accept or reject, record, change charts; events, stops, dense output.

Imports observables and below.

Begin with request.py (the request and the outcome of a run), then slices.py (the Python side: slices of calls of the
compiled driver) and stepper.py (the compiled driver: a step is proposed, attempted, rejected or accepted).
step_control.py chooses step sizes, trajectory.py evaluates dense output, event_search.py locates events in steps.
"""
