"""Copies of the loops, one for each kind and each function of a user's: what they share, what compiles them."""

import numba
import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.plug_ins import Rod
from tsdyn.jit.compiled import DEBUG, Callee
from tsdyn.jit.kernels import part, specialised

pytestmark = pytest.mark.skipif(DEBUG, reason="nothing is compiled")


def part_of(kernels, loop, name):
    return kernels[loop].py_func.__globals__[name]


def test_loops_share_the_parts_that_are_the_same_for_them():
    """One kernel for all loops of a kind, for kinds with the same markers, and for plug-ins."""
    C = ts.constraints
    shared = part_of(C.Distance.kernels, "reduced", "_place_markers")
    assert shared is part_of(C.Distance.kernels, "values", "_place_markers")
    assert shared is part_of(Rod.kernels, "reduced", "_place_markers")
    assert shared is not part_of(C.Dot1.kernels, "reduced", "_place_markers")


def load(scale):
    scene = ts.Scene()
    body = scene.add_body(1.0, (1, 1, 1))
    return ts.forces.PointForce(body, force=lambda t, state: (scale * state[7], 0.0, 0.0))


def test_parts_that_call_a_users_function_are_its_own():
    one, other = (load(scale).kernels for scale in (1.0, 2.0))
    assert part_of(one, "jacobian", "_law_derivatives") is not part_of(other, "jacobian", "_law_derivatives")
    assert part_of(one, "jacobian", "_add_products") is part_of(other, "jacobian", "_add_products")


def test_numba_compiles_a_users_function_alone_for_itself():
    """All between it and the loop is typed and lowered within the loop."""
    loop = load(3.0).kernels["force"].py_func
    law = loop.__globals__["kernel_law"]
    call = law.py_func.__globals__["function"]
    assert [type(found) for found in (law, call, part_of(load(3.0).kernels, "force", "force_markers"))] == [Callee] * 3
    assert isinstance(call.py_func.__globals__["function"], numba.core.registry.CPUDispatcher)


LEVEL = 1.0


@part
def _level(x):
    return LEVEL * x


def _twice(x):
    return 2.0 * _level(x)


def test_constants_of_a_part_are_told_apart_by_type():
    one, other, same = (specialised(_twice, f"twice{i}", _twice, LEVEL=level) for i, level in enumerate((1, True, 1)))
    assert one.__globals__["_level"] is not other.__globals__["_level"]
    assert one.__globals__["_level"] is same.__globals__["_level"]


def test_a_function_without_a_module_runs():
    """What a notebook's cell or `exec` makes is stored with all that it names."""
    names = {}
    exec("def pull(t, state):\n    return (0.0, 0.0, 2.0 - 3.0 * state[2])", names)
    scene = ts.Scene(gravity=(0, 0, 0))
    body = scene.add_point_mass(1.0, position=(0, 0, 1.0))
    scene.add(ts.forces.PointForce(body, force=names["pull"]))
    solution = ts.simulate(scene, (0.0, 1.0))
    expected = 2 / 3 + np.cos(np.sqrt(3.0)) / 3
    np.testing.assert_allclose(solution.position(body)[-1, 2], expected, atol=1e-6)
