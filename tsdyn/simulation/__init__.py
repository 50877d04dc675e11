"""`Scene`, `simulate` and `Solution`: the user's interface.

Imports ahead and below.

Begin with simulate.py, whose arguments options.py checks. scene_cache.py holds data shared by the runs of a scene,
method_choice.py chooses the default method, turns.py when another method goes on, singularity_crossing.py takes step
methods across singular configurations; segments.py runs what they say. termination.py reports the end of a run.
"""
