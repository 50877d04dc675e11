"""Ensembles: many runs of one scene with other parameters, on threads, processes or machines.

Imports simulation, storage and below. Loaded by `ts.ensemble` alone.

Begin with ensemble.py (`ts.ensemble`). cases.py is the table of parameters, keeping.py what is kept of a run. runner.py
runs one case after the other; arena.py has the arrays that its runs have in common, into which a case writes its
numbers (pen.py), starts.py checks its start. threads.py and executors.py share the cases out, results.py is the
`Ensemble`, stored.py its store.
"""
