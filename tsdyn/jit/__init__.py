"""Compilation: kernels, the cache of compiled kernels on disk, SIMD types.

The only package that uses Numba's decorators and code generation. Imports errors, nothing else of tsdyn.

Begin with kernels.py: `kernel` (a function that other kernels call), `entry` (called from Python), `Callback` (called
by address). compiler.py leaves out what Numba does for functions that Python calls. cache.py stores compiled kernels
under a hash of all code that they depend on (code_hash.py); resident.py lays out workspaces that kernels find by one
address, records of named numbers included; waiting.py counts kernels on stderr.
"""
