"""`Scene`, `simulate` and `Solution`: what a user calls.

Imports configuration and below.

Begin with simulate.py. scene_cache.py keeps what the runs of one scene share, method_choice.py chooses the default
method, singularity_crossing.py carries step methods past singular configurations, termination.py says how a run
ended.
"""
