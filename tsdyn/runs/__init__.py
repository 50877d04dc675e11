"""Runs: the front end of every driver, and the driver of step methods; events, stops, dense output.

Imports observables and below.

Begin with task.py (the request of a run, and its outcome) and driver.py (the front end: one `run` for all engines,
which calls the compiled driver slice by slice). step_engine.py is the engine of methods with a step kernel, stepper.py
its compiled driver: a step is proposed, attempted, rejected or accepted. step_control.py chooses steps, dense_output.py
evaluates states between them, events.py finds events there, run_log.py keeps records.
"""
