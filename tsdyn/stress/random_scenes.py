"""Random scenes, whole and broken: trees, loops, nets, driven, rough, redundant, degenerate, far away, in any units.

`generate(seed)` is the scene of a seed. A run of it, by judgement.py, must succeed within the laws, or be refused, or
end with a message.
"""

from typing import NamedTuple

import numpy as np

from ..simulation.scene import Scene
from .random_parts import Draw, join, joint_friction, motor, spring

METHODS = ("default", "default", "default", "taylor", "dop853", "rk45", "nystrom4")
SIZES = ((0.9, 2, 12), (0.99, 12, 60), (1.0, 60, 400))  # share of scenes up to here, bodies from, to


class Case(NamedTuple):
    """A scene and how it is to be run."""

    name: str
    scene: Scene
    span: tuple  # s
    options: dict
    assembled: bool = False  # whether `scene.assemble` comes first
    length: float = 1.0  # its unit of length, m


def tree(d, n, lean=0.0):
    """Each body hangs on one before it, or on the ground."""
    places, bodies = [np.zeros(3)], [d.scene.ground]
    for _ in range(n):
        i = int(d.rng.integers(len(bodies))) if d.rng.random() < 0.4 else len(bodies) - 1
        places.append(places[i] + d.unit())
        bodies.append(d.body(places[-1], d.rng.random() < lean))
        join(d, bodies[i], bodies[-1])


def lean_tree(d, n):
    """The same of bodies without inertia about an axis, many of which nothing holds about it."""
    tree(d, n, d.rng.choice((1.0 / n, 0.3)))


def floating(d, n):
    """A tree that touches the ground nowhere."""
    places, bodies = [np.zeros(3)], [d.body(np.zeros(3))]
    for _ in range(n - 1):
        i = int(d.rng.integers(len(bodies)))
        places.append(places[i] + d.unit())
        bodies.append(d.body(places[-1]))
        join(d, bodies[i], bodies[-1])


def loops(d, n):
    """A tree whose bodies are joined to others here and there."""
    tree(d, n)
    if len(d.scene.bodies) < 2:
        return
    for _ in range(int(d.rng.integers(1, 2 + n // 10))):
        a, b = d.rng.choice(d.scene.bodies, 2, replace=False)
        join(d, a, b, ("Distance", "Spherical", "PlaneContact"))


def net(d, n):
    """A cloth: bodies on a grid, each joined to its neighbours by balls or rods."""
    side = max(int(np.sqrt(n)), 2)
    kinds = (("Distance",), ("Spherical", "Distance"), ("Spherical",))[d.rng.integers(3)]
    grid = {}
    for i in range(side):
        for j in range(side):
            grid[i, j] = d.body(np.array((i, j, 0.0)) + d.rng.normal(size=3) * d.rng.choice((0.0, 0.05)))
            for other in ((i - 1, j), (i, j - 1)):
                if other in grid:
                    join(d, grid[other], grid[i, j], kinds)
    join(d, d.scene.ground, grid[0, 0], ("Spherical",))


def planar(d, n):
    """A planar row of four-bars with revolutes: redundant; sometimes flat, which is singular."""
    flat, last = d.rng.random() < 0.3, None
    for i in range(max(n // 3, 1)):
        angle = 0.0 if flat else d.rng.uniform(0.5, 2.5)
        foot = np.array((i, 0.0, 0.0))
        tip = foot + np.array((np.cos(angle), np.sin(angle), 0.0))
        crank = d.body(0.5 * (foot + tip))
        joins = [(d.scene.ground, crank, foot)]
        if last is not None:
            rod = d.body(0.5 * (last[1] + tip))
            joins += [(last[0], rod, last[1]), (rod, crank, tip)]
        for a, b, point in joins:
            if all(body.dimension != 3 for body in (a, b)):
                join(d, a, b, ("Revolute",), axis=(0.0, 0.0, 1.0), point=point)
        last = crank, tip


def star(d, n):
    """Everything hangs on one body."""
    hub = d.body(np.zeros(3), rigid=True, mass=10.0)
    join(d, d.scene.ground, hub, ("Revolute", "Spherical", "Cylindrical"))
    for _ in range(n):
        join(d, hub, d.body(d.unit()))


def crowd(d, n):
    """Joints between bodies at random: overconstrained as a rule, locked or singular."""
    bodies = [d.body(d.rng.normal(size=3) * 3.0) for _ in range(n)]
    for _ in range(int(n * d.rng.uniform(0.5, 1.5))):
        a, b = d.rng.choice([d.scene.ground, *bodies], 2, replace=False)
        join(d, a, b)


def degenerate(d, n):
    """A chain along a line, its axes all parallel or along it, with joints there twice, and some that contradict."""
    axis = np.append(d.rng.choice((0.0, 1.0), 2), 1e-9)
    last = d.scene.ground
    for i in range(n):
        body = d.body(np.array((i + 1.0, 0.0, 0.0)))
        for _ in range(1 + int(d.rng.random() < 0.2)):
            join(d, last, body, axis=axis / np.linalg.norm(axis))
        last = body if body.dimension != 3 else last
    if d.rng.random() < 0.3 and n > 1:
        join(d, d.scene.bodies[0], d.scene.bodies[-1], ("Distance",))


def far(d, n):
    """A tree a long way from the origin."""
    d.origin = d.unit() * 10.0 ** d.rng.uniform(2.0, 7.0)
    post = d.body(np.zeros(3), rigid=True)
    join(d, d.scene.ground, post, ("Fixed",), point=np.zeros(3))
    last, place = post, np.zeros(3)
    for _ in range(n):
        place = place + d.unit()
        body = d.body(place)
        join(d, last, body)
        last = body if body.dimension != 3 else last


def driven(d, n):
    """A tree, some joints of which are motors or drivers."""
    tree(d, n)
    for body in d.scene.bodies[:: max(n // 3, 1)]:
        motor(d, body)


def rough(d, n):
    """A tree with friction in its joints."""
    tree(d, n)
    joint_friction(d)


def lopsided(d, n):
    """A tree, whose masses differ by up to twelve decades."""
    d.spread = d.rng.uniform(1.0, 12.0)
    tree(d, n)


KINDS = {
    each.__name__: each
    for each in (
        tree, lean_tree, floating, loops, net, planar, star, crowd, degenerate, far, driven, rough, lopsided,
    )
}  # fmt: skip


def generate(seed, least=None, most=None):
    """Return the `Case` of a seed; of so many bodies, about, where that is given."""
    return drawn(np.random.default_rng(seed), least, most)


def drawn(rng, least=None, most=None):
    """Return the `Case` that a generator of random numbers draws."""
    share = rng.random()
    if least is None:
        least, most = next(sizes for limit, *sizes in SIZES if share < limit)
    name, n = str(rng.choice(list(KINDS))), int(np.exp(rng.uniform(np.log(least), np.log(most))))
    d = Draw(rng)
    KINDS[name](d, n)
    if rng.random() < 0.3:
        for body in d.scene.bodies[:: max(n // 5, 1)]:
            spring(d, body)
    moving(d)
    method = str(rng.choice(METHODS))
    options = {} if method == "default" else {"integrator": method}
    if method == "nystrom4":
        options = {"integrator": d.fixed_step()}
    elif method != "taylor":
        options |= {"rtol": 1e-8, "atol": 1e-8 * min(d.length, 1.0)}
    if rng.random() < 0.1 and len(d.scene.bodies) < 15 and method != "taylor" and d.is_si:
        options["formulation"] = "null-space"
    span = 0.0, float(rng.uniform(0.02, 0.5)) * d.time
    return Case(f"{name}, {len(d.scene.bodies)} bodies, {method}", d.scene, span, options, d.assembled, d.length)


def moving(d):
    """Give the bodies velocities, or put them off the constraints; most of which are assembled after that."""
    way = d.rng.random()
    if way < 0.4:
        for body in d.scene.bodies:
            body.velocity = d.rng.normal(size=3) * 0.3 * d.length / d.time
            if body.dimension != 3:
                body.angular_velocity = d.rng.normal(size=3) / d.time
    if 0.3 < way < 0.5:
        for body in d.scene.bodies:
            body.position = body.position + d.rng.normal(size=3) * 10.0 ** d.rng.uniform(-9.0, -1.0) * d.length
    d.assembled = (d.assembled or way < 0.5) and d.rng.random() < 0.8
