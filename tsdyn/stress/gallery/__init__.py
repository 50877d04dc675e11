"""Hard cases: mechanisms with redundant rows, singular configurations, stiffness, instability, hundreds of bodies.

Each function builds a scene by the public interface, and may be called with other sizes. Imports simulation and below.
Begin with cases.py, which lists the cases with their durations and says what makes each one hard.
"""
