"""The driver of step methods: attempt, accept or reject, record, change charts; events, stops, dense output.

Imports observables and below.

Begin with task.py (what is asked of a run, and what it hands back), then slices.py (Python's side: the compiled
driver called slice by slice) and stepper.py (the compiled driver: a step is proposed, tried, rejected or accepted).
step_control.py chooses steps, trajectory.py evaluates dense output, event_search.py finds events inside steps.
"""
