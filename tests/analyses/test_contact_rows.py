"""What pushes at gaps do, by the factors of S, against dense matrices of the free scene."""

import numpy as np
import pytest
from scipy.linalg import null_space

import tsdyn as ts
from tsdyn.analyses.contact_problem import Inertia
from tsdyn.observables.evaluate import constraint_arrays
from tsdyn.simulation.phase_scenes import gaps_of, phase_of

C = ts.constraints


def linkage(kind):
    """A loop of four links with contacts: redundant in space, or with rotor inertia, a massless axis, a law of time."""
    scene = ts.Scene(gravity=(1.0, 0, -9.81))
    points = [np.array(p, float) for p in ((0, 0, 0), (0, 0, 1), (2, 0, 1.5), (2, 0, 0))]
    links = []
    for i in range(3):
        inertia = (0.2, 0.2, 0.0) if kind == "massless" and i == 0 else (0.1, 0.2, 0.3)
        position = (points[i] + points[i + 1]) / 2
        links.append(scene.add_body(mass=1.0 + i, inertia=inertia, position=position, name=f"link {i}"))
    ends = [scene.ground, *links, scene.ground]
    hinges = [
        scene.add(C.Revolute.at(ends[i], ends[i + 1], point=points[i], axis=(0, 1, 0))) for i in range(4 if kind else 3)
    ]
    if kind == "armature":
        scene.add(ts.forces.Armature(hinges[0], inertia=0.5, ratio=3.0))
        scene.add(ts.forces.PointForce(links[1], force=lambda t: (np.cos(t), 0, 0)))
    for i, link in enumerate(links):
        ball = {"center_a": (0.1, 0.2, 0.3 * i), "radius_a": 0.05, "center_b": (0, 0, -2)}
        scene.add(C.SphereContact(link, scene.ground, **ball, normal_b=(0.6, 0, 0.8)))
    scene.add(C.SphereContact(links[0], links[2], radius_a=0.1, radius_b=0.1))
    scene.add(C.Stop(hinges[0], lower=-0.5, upper=0.7))
    scene.set(hinges[0], rate=0.8)
    scene.assemble()
    return scene


@pytest.mark.parametrize("kind", ["", "loop", "armature", "massless"])
def test_inertia_of_gaps(kind):
    scene = linkage(kind)
    q, qd = scene.start
    free, gaps = phase_of(scene, []), gaps_of(scene)
    ts.simulate(scene, (0.0, 1e-3))  # a start finds redundant rows
    _, Phi_q, _, gamma = constraint_arrays(scene.packed.system, q, qd, 0.3)
    alone, J = free.evaluate(q, qd, 0.3), gaps.sign[:, None] * Phi_q[gaps.rows]
    Z = null_space(alone.Phi_q)
    M = Z.T @ alone.M @ Z
    inertia = Inertia(gaps, 0.3, q, np.zeros(free.packed.system.memory.size), range(gaps.count))
    np.testing.assert_allclose(inertia.J, J, atol=1e-14)
    np.testing.assert_allclose(inertia.G, J @ Z @ np.linalg.solve(M, Z.T @ J.T), atol=1e-11)
    loads = np.random.default_rng(0).normal(size=(q.size, 3))
    np.testing.assert_allclose(inertia.free(loads), Z @ np.linalg.solve(M, Z.T @ loads), atol=1e-10)
    np.testing.assert_allclose(inertia.rates(qd), J @ qd, atol=1e-13)
    expected = J @ alone.qdd + gaps.sign * gamma[gaps.rows]
    np.testing.assert_allclose(inertia.accelerations(qd)[0], expected, atol=1e-9)
    other = qd + 0.1 * Z[:, 0]
    gain = 0.5 * (other @ alone.M @ other - qd @ alone.M @ qd)
    assert abs(gaps.workspace.gain(q, qd, other) - gain) < 1e-13
    some = Inertia(gaps, 0.3, q, np.zeros(free.packed.system.memory.size), [1, 3])
    np.testing.assert_allclose(some.among([1, 3]), inertia.among([1, 3]), rtol=1e-12)
