"""Figures of a solution and of a linearisation, by matplotlib: axes are returned, and every label has its unit.

`histories` and `phase` draw into the caller's axes, or into new ones, `modes` draws mode shapes. matplotlib is imported
on first use. Imports `viewer` and what is below. Begin with `histories`.
"""
