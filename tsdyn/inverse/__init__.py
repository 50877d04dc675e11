"""Motions that are given: kinematic analysis, inverse dynamics.

Imports statics and below.

Begin with analysis.py (`scene.kinematics`): continuation of a configuration without freedom from time to time, by the
steps of branch_steps.py. loads.py has inverse dynamics: drivers.py makes the motion of coordinates one of the scene,
actuators.py the generalised forces of what may drive it.
"""
