"""Trees of joints with loops that are known to close: built closed, then displaced joint by joint, far away."""

import numpy as np

import tsdyn as ts
from tests.helpers.sketches import turned, unit

C = ts.constraints
ONE_AXIS = C.Revolute, C.Translational, C.Cylindrical


def closed_tree(rng, count, loops, far=1.5):
    """A scene whose `loops` are open, and its loops; all joints of the tree hold.

    A loop ties a body to one elsewhere in the tree: by a weld where the joints between leave enough freedom, else by a
    ball or a hinge. Joints are displaced by up to `far` rad, slides by up to 0.3 m.
    """
    scene, parents, freedom = ts.Scene(), {}, {}
    for i in range(count):
        parent = scene.ground if not i else scene.bodies[rng.integers(max(0, i - 3), i)]
        start = np.zeros(3) if parent is scene.ground else parent.position
        body = scene.add_body(
            rng.uniform(0.5, 2.0), rng.uniform(0.1, 0.15, 3), start + rng.uniform(0.3, 0.8) * unit(rng),
            turned(np.array([1.0, 0.0, 0.0, 0.0]), rng.uniform(0.0, 3.0) * unit(rng)), name=f"link {i}",
        )  # fmt: skip
        _add_joint(scene, rng, parent, body, freedom)
        parents[body] = parent
    found = []
    for k in range(loops):
        one, other = rng.choice(count, 2, replace=False)
        a, b = scene.bodies[one], scene.bodies[other]
        free = sum(freedom[body] for body in _between(parents, a, b))
        place = {"point": 0.5 * (a.position + b.position) + 0.1 * unit(rng)}
        if free >= 7:
            found.append(C.Fixed.at(a, b, **place, name=f"weld {k}"))
        elif free >= 6:
            found.append(C.Revolute.at(a, b, **place, axis=unit(rng), name=f"pin {k}"))
        elif free >= 4:
            found.append(C.Spherical.at(a, b, **place, name=f"ball {k}"))
        else:
            continue
        for body in _between(parents, a, b):
            freedom[body] = 0  # each joint serves one loop
    for joint in list(scene.constraints):
        if isinstance(joint, (C.Revolute, C.Cylindrical)):
            scene.set(joint, angle=rng.uniform(-far, far))
        elif isinstance(joint, C.Translational):
            scene.set(joint, displacement=rng.uniform(-0.3, 0.3))
    for loop in found:
        scene.add(loop)
    return scene, found


def _add_joint(scene, rng, parent, body, freedom):
    """A joint half-way between a body and its parent."""
    start = np.zeros(3) if parent is scene.ground else parent.position
    point, kind = 0.5 * (start + body.position), rng.integers(6)
    name = f"joint of {body.name}"
    if kind == 5:
        scene.add(C.Spherical.at(parent, body, point=point, name=name))
    else:
        cls = ONE_AXIS[max(0, kind - 2)]
        scene.add(cls.at(parent, body, point=point, axis=unit(rng), name=name))
    freedom[body] = {5: 3, 4: 2}.get(kind, 1)


def _between(parents, a, b):
    """The bodies whose joints are between two."""
    paths = []
    for body in (a, b):
        path = [body]
        while path[-1] in parents:
            path.append(parents[path[-1]])
        paths.append(path)
    common = set(paths[0]) & set(paths[1])
    return [body for path in paths for body in path if body not in common]
