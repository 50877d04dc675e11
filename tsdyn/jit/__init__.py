"""Compilation: kernels, the cache of compiled kernels on disk, SIMD types.

The only package that uses Numba's decorators and code generation. Imports errors, nothing else of tsdyn.

Begin with kernels.py: `kernel` (a function that other kernels call), `entry` (called from Python), `Callback` (called
by address). They are compiled by backend.py, the only file that uses what isn't public of Numba, or by stock.py, which
uses Numba as it comes; compilers.py chooses. cache.py stores kernels under a hash of all code that they depend on
(code_hash.py); resident.py lays out workspaces that kernels find by one address, records of named numbers included;
interrupts.py counts kernels on stderr.
"""
