"""Ensembles: many runs of one scene with other parameters, on threads, processes or machines.

Imports simulation, storage and below. Loaded by `ts.ensemble` alone.

Begin with ensemble.py (`ts.ensemble`). cases.py is the table of parameters, keeping.py what is kept of a run,
demands.py what is refused before the first one, user_functions.py how functions of a user are called. runner.py runs
the cases of a chunk; arena.py has the arrays that its runs have in common. pen.py lays out the numbers of a chunk
(body_columns.py, copied_columns.py, geometry_columns.py), case_loop.py is the compiled loop over its cases, for which
batch.py has what it needs of an arena; starts.py checks the start of a case that Python runs. threads.py and
executors.py share the cases out, results.py is the `Ensemble`, stored.py its store.
"""
