"""A short chain that ensembles run: rods on ball joints and a spring."""

import tsdyn as ts


def two_rods_on_a_spring():
    """Two rods on ball joints, the first on a spring."""
    scene, last = ts.Scene(gravity=(0, 0, -10)), None
    for i in range(2):
        rod = scene.add_body(1.0, (0.1, 0.1, 0.05), position=(i + 0.5, 0, 0), name=f"rod {i}")
        ends = {"point_a": (0.5, 0, 0) if last else (0, 0, 0), "point_b": (-0.5, 0, 0)}
        scene.add(ts.constraints.Spherical(last or scene.ground, rod, **ends, name=f"joint {i}"))
        last = rod
    scene.add(ts.forces.Spring(scene.bodies[0], scene.ground, stiffness=20.0, damping=0.1, name="spring"))
    return scene
