"""`ts.benchmark` and `ts.compare`: run time against error of methods and of other engines; the tables of Haug (2018).

Imports simulation and below. Begin with benchmark.py, which makes the reference solution of a scene, too; engines.py
has scenes in MuJoCo and Exudyn, for compare.py and the folder benchmarks/ of the repository.
"""
