"""`ts.profile`: run time of a call by phases, with advice.

Imports benchmarking, simulation and below. Begin with profile.py; instrumentation.py installs timers (timers.py) in the
workspace of a run, phases.py collects their readings, advice.py draws conclusions.
"""
