"""Phases and impulses of a run as lists and tables."""

import pickle

import numpy as np
import pytest

import tsdyn as ts

C = ts.constraints


def test_phases_and_impulses_say_what_sticks_and_print_as_tables(tmp_path):
    """A ball of 1 kg lands with 2 m/s, rebounds, slides from 0.6 s and sticks from 0.9 s; a sledge from 1 s."""
    scene = ts.Scene(gravity=(0, 0, -10))
    ball = scene.add_point_mass(1.0, position=(0, 0, 0.2), velocity=(0.9, 0, 0), name="ball")
    law = {"normal_b": (0, 0, 1), "unilateral": True, "restitution": 0.5, "kinetic": 0.1}
    scene.add(C.PlaneContact(ball, scene.ground, **law, name="floor"))
    sledge = scene.add_point_mass(1.0, velocity=(1, 0, 0), name="sledge")
    scene.add(C.PlaneContact(sledge, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.CoulombFriction(sledge, scene.ground, force=1.0, name="drag"))
    solution = ts.simulate(scene, (0, 2.0))
    last = solution.phases[-1]
    assert last == (pytest.approx(1.0, abs=1e-12), 2.0, ("floor", "drag"))
    assert last.sticking == ("floor", "drag")
    assert solution.phases[0].sticking == ()
    slides, sticks = solution.phases[-3:-1]
    assert (slides.names, slides.sticking, sticks.sticking) == (("floor",), (), ("floor",))
    np.testing.assert_allclose([slides.start, sticks.start], [0.6, 0.9], atol=1e-11)
    heads, *lines = str(solution.phases).splitlines()
    assert heads.split("  ")[0] == "start (s)"
    assert len(lines) == len(solution.phases)
    assert lines[-1].split("  ")[-2:] == ["floor, drag", "floor, drag"]
    assert "<th>sticks</th>" in solution.phases._repr_html_()
    assert str(solution.impulses).splitlines()[1].split() == ["0.2", "floor", "3", "-0.3,", "0,", "0"]
    loaded = ts.load(solution.save(tmp_path / "run.h5"))
    assert str(loaded.phases) == str(solution.phases)
    assert pickle.loads(pickle.dumps(solution.phases))[-1].sticking == last.sticking
