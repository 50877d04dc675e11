"""`ts.benchmark`: run time against error of methods on a user's scene; the tables of Haug (2018).

Imports simulation and below. Begin with benchmark.py; reference_solution.py makes the reference solution for
the errors.
"""
