"""Kernels compiled before they are needed, by several processes at a time.

Imports configuration and below; everything works without it, but a first run takes longer.

Begin with workers.py: processes that run worker.py fill the cache on disk. first_run.py says which kernels a run needs,
all_kernels.py which `tsdyn compile` compiles.
"""
