"""What one process has lowered, others link in; what belongs to one process alone isn't stored."""

import ctypes
import itertools
import pickle
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import types
from numba.core.bytecode import FunctionIdentity
from numba.core.registry import cpu_target

from tests.helpers.processes import REPORT, edit, run
from tsdyn.jit import cache, compilers, lanes, predicates, simd, stock
from tsdyn.jit.code_hash import types_hash
from tsdyn.jit.kernels import Seen

pytestmark = pytest.mark.skipif(compilers.current() is stock, reason="Numba's own cache stores no code to link in")


class Pair(NamedTuple):
    """What is in memory."""

    left: np.ndarray
    right: np.ndarray


LANE = lanes.lane_type(4)
OWN_TYPES = (
    LANE,
    lanes.lane_type(8, threes=True),
    LANE.four,
    LANE.four.three,
    types.Array(LANE, 2, "C"),
    predicates.Mask(4),
    simd.FOUR,
    Seen(numba.typeof(Pair(np.zeros(2), np.zeros(2)))),
)


@pytest.mark.parametrize("kind", OWN_TYPES, ids=str)
def test_types_are_stored(kind):
    assert pickle.loads(pickle.dumps(kind)) is kind


def test_all_own_types_are_tried():
    own = {kind for kind in types.Type.__subclasses__() if kind.__module__.startswith("tsdyn.")}
    assert own == {type(kind) for kind in OWN_TYPES} - {types.Array}


@pytest.fixture
def store(tmp_path, monkeypatch):
    """An empty folder of kernels for this process."""
    monkeypatch.setattr(cache, "folder", lambda: tmp_path)
    monkeypatch.setattr(cache, "folders", lambda: (tmp_path,))
    cpu_target.target_context.refresh()
    return tmp_path


@pytest.fixture
def nothing_lowered(monkeypatch):
    """A function after which lowering a callee is an error."""
    from tsdyn.jit import backend

    def lower(self, state):
        raise NotImplementedError

    return lambda: monkeypatch.setattr(backend._CalleeLowering, "run_pass", lower)


def callee(function, *kinds, **options):
    """A kernel of tsdyn's that kernels call, compiled for these types."""
    function.__module__ = "tsdyn"
    made = compilers.current().callee(function, {"error_model": "numpy", **options})
    made.compile(kinds)
    return made


def twice(x):
    return x + x


@pytest.mark.parametrize("kind", [types.int64, LANE], ids=str)
def test_a_callee_is_lowered_once(kind, store, nothing_lowered):
    first = callee(twice, kind).overloads[kind,].signature
    nothing_lowered()
    assert callee(twice, kind).overloads[kind,].signature == first == kind(kind)


def test_one_of_other_options_is_lowered_anew(store, nothing_lowered):
    callee(twice, types.int64)
    nothing_lowered()
    with pytest.raises(NotImplementedError):
        callee(twice, types.int64, boundscheck=True)


def times(factor):
    def level(x):
        return factor * x + max(x, 0.5 * factor)

    return level


def test_two_of_one_name_and_number_are_told_apart(store, nothing_lowered, monkeypatch):
    """Numba numbers functions in each process anew."""
    for factor in (3.0, 5.0):
        monkeypatch.setattr(FunctionIdentity, "_unique_ids", itertools.count(1 << 40))
        callee(times(factor), types.float64)
    nothing_lowered()
    three, five = (callee(times(factor), types.float64) for factor in (3.0, 5.0))

    def both(x):
        return three(x) + 10.0 * five(x)

    made = compilers.current().callback(both, types.float64(types.float64), {"error_model": "numpy"}, False)
    assert ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(made.address)(1.0) == 3.0 + 1.5 + 10.0 * (5.0 + 2.5)


def applied(law, x):
    return law(x)


def test_what_has_a_function_of_the_process_is_not_stored(store):
    law = numba.njit(lambda x: 2.0 * x)
    kind = numba.typeof(law)
    inner = callee(applied, kind, types.float64)
    callee(lambda laws, x: laws[1](x), types.Tuple((types.float64, kind)), types.float64)
    callee(lambda x: inner(law, x), types.float64)
    assert not list(store.glob("*.callee"))
    callee(twice, types.float64)
    assert [file.name.partition("-")[0] for file in store.glob("*.callee")] == ["tsdyn.twice"]


def test_one_of_a_class_that_has_moved_has_another_name():
    def hash_in(module):
        class Moved(NamedTuple):
            x: float

        Moved.__module__ = module
        return types_hash([numba.typeof(Moved(1.0))])

    assert hash_in("tsdyn.runs") == hash_in("tsdyn.runs") != hash_in("tsdyn.model")


LOWERED = """
from tsdyn.jit import backend
own, lowered = backend._CalleeLowering.run_pass, []
def run_pass(self, state):
    lowered.append(state.func_id.func_name)
    return own(self, state)
backend._CalleeLowering.run_pass = run_pass
from tsdyn.below.outer import once
report(value=once(1.0), lowered=lowered)
"""


@pytest.mark.slow
@pytest.mark.parametrize("damaged", [False, True])
def test_what_one_process_has_lowered_another_links_in(package, damaged):
    folder = package / "tsdyn" / "below"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "inner.py").write_text("from ..jit.kernels import kernel\n@kernel\ndef level(x):\n    return 3.0 * x\n")
    (folder / "outer.py").write_text(
        "from ..jit.kernels import entry\nfrom .inner import level\n@entry\ndef once(x):\n    return level(x)\n"
        "@entry\ndef twice(x):\n    return 2.0 * level(x)\n"
    )
    environment = {"NUMBA_CACHE_DIR": str(package / "cache")}
    first, _ = run(REPORT + LOWERED, environment, package)
    if damaged:
        for file in (package / "cache").rglob("*level*.callee"):
            file.write_bytes(file.read_bytes()[:-1])
    other, _ = run((REPORT + LOWERED).replace("once", "twice"), environment, package)
    assert (first["value"], "level" in first["lowered"]) == (3.0, True)
    assert (other["value"], other["lowered"]) == (6.0, ["level"] * damaged)
    edit(folder / "inner.py", "3.0", "5.0")
    edited, _ = run(REPORT + LOWERED, environment, package)
    assert (edited["value"], edited["lowered"]) == (5.0, ["level"])
