"""`ts.benchmark`: run time against error of methods on a scene of the user's; the tables of Haug (2018).

Imports simulation and below. Begin with benchmark.py; reference_solution.py makes the solution that errors are taken
from.
"""
