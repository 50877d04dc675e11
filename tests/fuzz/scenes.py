"""Random scenes, whole and broken: trees, loops, nets, redundant, degenerate, far away, without inertia.

    python -m tests.fuzz.scenes --count 1000 --seed 0

runs each in a process of its own that is ended after a time limit, and prints how they came out. A scene must run, or
be refused or end with a message; whatever else happens is a fault: another exception, a crash, silence. The first time
of all, kernels are compiled: give a limit of minutes.
"""

import argparse
import multiprocessing
import time
from collections import Counter
from typing import NamedTuple

import numpy as np

import tsdyn as ts

C, F, I = ts.constraints, ts.forces, ts.integrators
PINS = ("Revolute", "Spherical", "Universal", "Cylindrical", "Translational", "Fixed", "PlaneContact", "Distance")
WEIGHTS = np.array((8, 5, 3, 2, 1, 1, 2, 3)) / 25.0
METHODS = ("default", "default", "default", "dop853", "rk45", "nystrom4")
LIMIT = 60.0  # s, of a scene


class Case(NamedTuple):
    """A scene and how it is to be run."""

    name: str
    scene: ts.Scene
    span: tuple
    options: dict


def unit(rng):
    """A direction."""
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def add_body(scene, rng, position, lean=False):
    """A body at a random orientation; one that is lean has no inertia about an axis."""
    if rng.random() < 0.05:
        return scene.add_point_mass(mass=rng.uniform(0.1, 3.0), position=position)
    a, b, share = rng.uniform(0.02, 0.3, 3)
    inertia = (0.0, a, a) if lean else (a, b, abs(a - b) + share * min(a, b))
    p = rng.normal(size=4)
    return scene.add_body(rng.uniform(0.1, 3.0), inertia, position, p / np.linalg.norm(p))


def join(scene, rng, a, b, kinds=PINS, axis=None):
    """Some joint between two bodies where they stand, which holds there."""
    ends = [np.asarray(body.position) for body in (a, b)]
    rigid = [body for body in (a, b) if body.dimension != 3]
    kind = rng.choice(kinds, p=WEIGHTS if kinds is PINS else None) if len(rigid) == 2 else "Distance"
    point = ends[0] + rng.uniform(0.2, 0.8) * (ends[1] - ends[0])
    axis = unit(rng) if axis is None else axis
    if kind == "Distance":
        points = {f"point_{x}": rng.normal(size=3) * 0.1 for x, body in zip("ab", (a, b), strict=True) if body in rigid}
        scene.add(C.Distance(a, b, **points))
    elif kind == "PlaneContact":
        scene.add(C.PlaneContact.at(a, b, point=point, normal=axis))
    elif kind in ("Spherical", "Fixed"):
        scene.add(getattr(C, kind).at(a, b, point=point))
    elif kind == "Universal":
        other = np.cross(axis, unit(rng))
        scene.add(C.Universal.at(a, b, point=point, axis=axis, axis_b=other / np.linalg.norm(other)))
    else:
        scene.add(getattr(C, kind).at(a, b, point=point, axis=axis))


def tree(rng, n, lean=0.0):
    """Each body hangs on one before it or on the ground."""
    scene = ts.Scene(gravity=rng.normal(size=3) * 5.0)
    places, bodies = [np.zeros(3)], [scene.ground]
    for _ in range(n):
        i = int(rng.integers(len(bodies))) if rng.random() < 0.4 else len(bodies) - 1
        places.append(places[i] + unit(rng))
        bodies.append(add_body(scene, rng, places[-1], rng.random() < lean))
        join(scene, rng, bodies[i], bodies[-1])
    return scene


def lean_tree(rng, n):
    """The same of bodies without inertia about an axis, many of which nothing holds about it."""
    return tree(rng, n, rng.choice((1.0 / n, 0.3)))


def loops(rng, n):
    """A tree whose bodies are joined to others here and there."""
    scene = tree(rng, n)
    for _ in range(int(rng.integers(1, 2 + n // 10))):
        a, b = rng.choice(scene.bodies, 2, replace=False)
        join(scene, rng, a, b, ("Distance", "Spherical", "PlaneContact"))
    return scene


def net(rng, n):
    """A cloth: bodies on a grid, each joined to its neighbours by balls or rods."""
    scene, side = ts.Scene(), max(int(np.sqrt(n)), 2)
    kinds = (("Distance",), ("Spherical", "Distance"), ("Spherical",))[rng.integers(3)]
    grid = {}
    for i in range(side):
        for j in range(side):
            grid[i, j] = add_body(scene, rng, np.array((i, j, 0.0)) + rng.normal(size=3) * rng.choice((0.0, 0.05)))
            for other in ((i - 1, j), (i, j - 1)):
                if other in grid:
                    join(scene, rng, grid[other], grid[i, j], kinds)
    join(scene, rng, scene.ground, grid[0, 0], ("Spherical",))
    return scene


def planar(rng, n):
    """A planar row of four-bars with revolutes: redundant; sometimes flat, which is singular."""
    scene = ts.Scene(gravity=(0.0, -9.81, 0.0))
    flat, last = rng.random() < 0.3, None
    for i in range(max(n // 3, 1)):
        angle = 0.0 if flat else rng.uniform(0.5, 2.5)
        tip = np.array((i + np.cos(angle), np.sin(angle), 0.0))
        crank = add_body(scene, rng, 0.5 * (np.array((i, 0.0, 0.0)) + tip))
        joins = [(scene.ground, crank, np.array((i, 0.0, 0.0)))]
        if last is not None:
            rod = add_body(scene, rng, 0.5 * (last[1] + tip))
            joins += [(last[0], rod, last[1]), (rod, crank, tip)]
        for a, b, point in joins:
            if all(body.dimension != 3 for body in (a, b)):
                scene.add(C.Revolute.at(a, b, point=point, axis=(0.0, 0.0, 1.0)))
        last = crank, tip
    return scene


def star(rng, n):
    """Everything hangs on one body."""
    scene = ts.Scene()
    hub = scene.add_body(10.0, (1.0, 1.0, rng.choice((1.0, 0.0))))
    join(scene, rng, scene.ground, hub, ("Revolute", "Spherical", "Cylindrical"))
    for _ in range(n):
        join(scene, rng, hub, add_body(scene, rng, unit(rng)))
    return scene


def crowd(rng, n):
    """Joints between bodies at random: overconstrained as a rule, locked or singular."""
    scene = ts.Scene()
    bodies = [add_body(scene, rng, rng.normal(size=3) * 3.0) for _ in range(n)]
    for _ in range(int(n * rng.uniform(0.5, 1.5))):
        a, b = rng.choice([scene.ground, *bodies], 2, replace=False)
        join(scene, rng, a, b)
    return scene


def degenerate(rng, n):
    """A chain along a line, its axes all parallel or along it, with joints there twice, and some that contradict."""
    scene, axis = ts.Scene(), np.append(rng.choice((0.0, 1.0), 2), 1e-9)
    last = scene.ground
    for i in range(n):
        body = add_body(scene, rng, np.array((i + 1.0, 0.0, 0.0)))
        for _ in range(1 + int(rng.random() < 0.2)):
            join(scene, rng, last, body, axis=axis / np.linalg.norm(axis))
        last = body if body.dimension != 3 else last
    if rng.random() < 0.3:
        scene.add(C.Distance(scene.bodies[0], scene.bodies[-1], length=0.7 * n))
    return scene


def far(rng, n):
    """A tree a long way from the origin."""
    scene, place = tree(rng, n), unit(rng) * 10.0 ** rng.uniform(2.0, 7.0)
    away = ts.Scene(gravity=scene.gravity)
    post = away.add_body(1.0, (1.0, 1.0, 1.0), place)
    away.add(C.Fixed.at(away.ground, post, point=place))
    last = post
    for body in scene.bodies:
        other = add_body(away, rng, place + body.position)
        join(away, rng, last, other)
        last = other if other.dimension != 3 else last
    return away


KINDS = {each.__name__: each for each in (tree, lean_tree, loops, net, planar, star, crowd, degenerate, far)}


def generate(seed, least=40, most=2000):
    """The `Case` of a seed, of about so many bodies."""
    rng = np.random.default_rng(seed)
    name, n = str(rng.choice(list(KINDS))), int(np.exp(rng.uniform(np.log(least), np.log(most))))
    scene = KINDS[name](rng, n)
    if rng.random() < 0.3:
        for body in scene.bodies[:: max(n // 5, 1)]:
            k, c, point = 10.0 ** rng.uniform(0.0, 5.0), rng.uniform(0.0, 1.0), body.position + unit(rng)
            scene.add(F.Spring(scene.ground, body, point_a=point, stiffness=k, damping=c))
    if rng.random() < 0.2:
        for body in scene.bodies:
            body.velocity = rng.normal(size=3) * 0.3
    method = str(rng.choice(METHODS))
    options = {} if method == "default" else {"integrator": method}
    if rng.random() < 0.1:
        options["formulation"] = "null-space" if len(scene.bodies) < 60 else "tangent"
    return Case(f"{name}, {len(scene.bodies)} bodies, {method}", scene, (0.0, float(rng.uniform(0.02, 0.5))), options)


def outcome(case):
    """How a case came out: a word for the table, and what there is to say about it."""
    try:
        solution = ts.simulate(case.scene, case.span, **case.options)
    except ts.TsdynError as error:
        return type(error).__name__, str(error)
    except Exception as error:
        return f"FAULT {type(error).__name__}", str(error)
    arrays = (solution.t, solution.q, solution.qd, solution.qdd)
    if not all(np.isfinite(array).all() for array in arrays):
        return "FAULT not finite", solution.message
    size = 1.0 + np.abs(solution.q).max(initial=0.0)
    if solution.constraint_error.position.max(initial=0.0) > 1e-9 * size:
        return "FAULT off the constraints", solution.message
    if not solution.success and not solution.message:
        return "FAULT no message", str(solution.status)
    return str(solution.status), solution.message


def _work(connection):
    """Run the cases whose seeds and sizes come in, one by one."""
    while True:
        seed, least, most = connection.recv()
        case = generate(seed, least, most)
        connection.send(case.name)
        began = time.perf_counter()
        connection.send((*outcome(case), time.perf_counter() - began))


class Runner:
    """Runs cases in a process that is replaced when it is silent for too long, or crashes."""

    def __init__(self, limit=LIMIT):
        self.limit, self.process = limit, None

    def _start(self):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_work, args=(other,), daemon=True)
        self.process.start()
        other.close()

    def run(self, seed, least, most):
        """(name, outcome, what it said, seconds) of a seed."""
        if self.process is None:
            self._start()
        self.connection.send((seed, least, most))
        name = f"seed {seed}"
        try:
            for _ in range(2):
                if not self.connection.poll(self.limit):
                    self.end()
                    return name, "FAULT silent", f"for {self.limit:g} s", self.limit
                said = self.connection.recv()
                if isinstance(said, str):
                    name = said
            return name, *said
        except EOFError:
            code = self.process.exitcode
            self.end()
            return name, "FAULT crash", f"exit code {code}", 0.0

    def end(self):
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.join()
            self.process = None


def main(arguments=None):
    """The command line; 1 where there were faults."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.scenes", description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds for a scene")
    parser.add_argument("--least", type=int, default=40, help="bodies")
    parser.add_argument("--most", type=int, default=2000, help="bodies")
    parser.add_argument("--slow", type=float, default=10.0, help="scenes that take longer are listed")
    given = parser.parse_args(arguments)
    runner, table, times, faults = Runner(given.limit), Counter(), {}, 0
    for seed in range(given.seed, given.seed + given.count):
        name, word, said, seconds = runner.run(seed, given.least, given.most)
        kind = name.partition(",")[0]
        table[word, kind] += 1
        times[word] = max(times.get(word, 0.0), seconds)
        if word.startswith("FAULT") or seconds > given.slow:
            faults += word.startswith("FAULT")
            print(f"seed {seed}: {name}: {word} after {seconds:.1f} s. {said[:200]}", flush=True)
    runner.end()
    words = sorted({word for word, _ in table})
    width = max(map(len, words), default=0)
    print(f"\n{'':{width}}  " + " ".join(f"{kind:>10}" for kind in KINDS) + "      all  longest, s")
    for word in words:
        counts = [table[word, kind] for kind in KINDS]
        print(f"{word:{width}}  " + " ".join(f"{n:10d}" for n in counts) + f" {sum(counts):8d} {times[word]:11.1f}")
    return int(faults > 0)


if __name__ == "__main__":
    raise SystemExit(main())
