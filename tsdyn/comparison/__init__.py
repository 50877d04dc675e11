"""`ts.compare`: the run of another engine, against tsdyn at 1e-12.

Imports simulation and what lies below it; engines are imported when they are asked for. Begin with compare.py.
exudyn_scene.py and mujoco_scene.py build a scene there and run it; result.py holds the differences and draws them.
"""
