"""`ts.profile`: where the time of a run goes, phase by phase, and what to change.

Imports benchmarking, simulation and below. Begin with profile.py; instrumentation.py puts timers (timers.py) into the
memory of a run, phases.py puts together what these found, advice.py draws conclusions.
"""
