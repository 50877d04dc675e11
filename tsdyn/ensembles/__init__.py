"""Ensembles: many runs of one scene with other parameters, on threads, processes or machines.

Imports simulation, storage and below. Loaded by `ts.ensemble` alone.

Begin with ensemble.py (`ts.ensemble`). cases.py is the table of parameters, and what is kept of a run. runner.py runs
the cases of a chunk in arrays that they have in common, case_numbers.py lays out the numbers of its cases, case_loop.py
and lanes.py are the compiled loops over them. executors.py shares the cases out, results.py is the `Ensemble`,
stored.py its store.
"""
