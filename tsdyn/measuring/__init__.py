"""`ts.benchmark`, `ts.compare` and `ts.profile`: run time against error, other engines, run time by phases.

Imports simulation and below. Begin with benchmark.py, which makes the reference solution of a scene, too; engines.py
has scenes in MuJoCo and Exudyn, for compare.py and the folder benchmarks/ of the repository; haug_tables.py has the
tables of Haug (2018). profile.py measures a call and draws conclusions; phase_times.py times kernels in a run, and
shares these times among their parts.
"""
