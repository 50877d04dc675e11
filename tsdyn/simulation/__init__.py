"""`Scene`, `prepare`, `simulate` and `Solution`: the user's interface.

Imports ahead and below.

Begin with run_options.py (the options of a run) and prepared_run.py (a `Run`: the options made concrete for a scene;
`simulate` is prepare and run). scene_cache.py holds data shared by the runs of a scene, segments.py changes methods on
the way and crosses singular configurations, termination.py reports the end of a run.
"""
