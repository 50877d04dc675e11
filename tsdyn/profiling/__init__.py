"""`ts.profile`: run time of a call by phases, with advice.

Imports benchmarking, simulation and below. Begin with profile.py; timers.py times kernels in a run, phases.py shares
these times among their parts, advice.py draws conclusions.
"""
