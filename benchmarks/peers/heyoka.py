"""heyoka (Taylor series compiled for the one system) on the sliding top in minimal coordinates: the limit.

The state is p, omega'; the tip keeps its x and y, and its height follows from the tilt. As in by_hand/taylor_top.py.
"""

import numpy as np

from ..contender import Contender, Outcome, rotation, timed


class Heyoka(Contender):
    """The sliding top only."""

    name = "heyoka, minimal coordinates"
    values = tuple(10.0**-k for k in range(3, 17))
    package, get = "heyoka", "pip install heyoka"

    def serves(self, scene):
        """The sliding top."""
        return scene.family == "top"

    def prepare(self, scene):
        """Compile for each tolerance once."""
        definition, compiled = scene.definition(), {}
        start = start_of(definition)

        def run(tol):
            if tol not in compiled:
                compiled[tol] = integrator(definition, tol=tol)
            taylor = compiled[tol]
            taylor.time, taylor.state[:] = 0.0, start
            seconds, _ = timed(taylor.propagate_until, scene.end)
            A = rotation(taylor.state[None, :4])
            return Outcome(seconds, np.array([[0.0, 0.0, A[0, 2, 2]]]), A)

        return run


def start_of(definition):
    """The state p, omega' at the start."""
    body = definition["bodies"][0]
    return np.array([*body["orientation"], *body["angular_velocity"]], float)


def integrator(definition, **options):
    """The sliding top's `taylor_adaptive`."""
    import heyoka as hy

    return hy.taylor_adaptive(equations(definition), start_of(definition), **options)


def batch(definition, **options):
    """As many tops at once as fit into a SIMD register, with a common step: `taylor_adaptive_batch`; and how many."""
    import heyoka as hy

    lanes = hy.recommended_simd_size()
    starts = np.tile(start_of(definition)[:, None], (1, lanes))
    return hy.taylor_adaptive_batch(equations(definition), starts, **options), lanes


def equations(definition):
    """Derivatives of e0 to e3 and of omega', in heyoka's expressions."""
    import heyoka as hy

    body, gravity = definition["bodies"][0], -definition["gravity"][2]
    m, J = body["mass"], np.diag(body["inertia"])
    e0, e1, e2, e3, a, b, c = hy.make_vars("e0", "e1", "e2", "e3", "a", "b", "c")
    nx, ny = 2.0 * (e1 * e3 - e0 * e2), 2.0 * (e2 * e3 + e0 * e1)
    nz = e0 * e0 - e1 * e1 - e2 * e2 + e3 * e3
    ga, gb = (J[0] - J[2]) / J[0] * b * c, (J[2] - J[0]) / J[0] * a * c
    bias = (ny * c - nz * b) * b - (nz * a - nx * c) * a + nx * gb - ny * ga
    lam = (bias + gravity) / (1.0 / m + (nx * nx + ny * ny) / J[0])
    return [
        (e0, -0.5 * (e1 * a + e2 * b + e3 * c)),
        (e1, 0.5 * (e0 * a - e3 * b + e2 * c)),
        (e2, 0.5 * (e3 * a + e0 * b - e1 * c)),
        (e3, 0.5 * (e1 * b - e2 * a + e0 * c)),
        (a, ga + lam / J[0] * ny),
        (b, gb - lam / J[0] * nx),
        (c, 0.0 * c),
    ]
