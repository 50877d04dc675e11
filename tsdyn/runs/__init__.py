"""Runs: the front end of every driver, and the driver of step methods; events, stops, dense output.

Imports observables and below.

Begin with task.py (what is asked of a run, and what it hands back) and run.py (the front end: one `run` for all
engines), then slices.py (the compiled driver called slice by slice). step_engine.py is the engine of methods with a
step kernel, stepper.py its compiled driver: a step is proposed, attempted, rejected or accepted. step_control.py
chooses steps, dense_output.py and reader.py evaluate states between them, event_search.py finds events there.
"""
