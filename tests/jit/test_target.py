"""The processor that kernels are compiled for: a portable target by default, beside what Numba compiles for users."""

import platform

import pytest

from tests.helpers.processes import REPORT, TINY, run
from tsdyn.jit import backend, compilers, stock, target

own = pytest.mark.skipif(compilers.current() is stock, reason="Numba as it comes compiles for its own target")
portable = pytest.mark.skipif(not target.available(), reason="a processor without portable targets")
MACHINE = REPORT + "from tsdyn.jit import compilers\nreport(machine=compilers.machine())\n"


def machine(**environment):
    found, errors = run(MACHINE, environment)
    return found["machine"], errors


@pytest.mark.slow
@own
@portable
def test_the_best_portable_target_is_the_default(monkeypatch):
    for name in ("TSDYN_TARGET", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX"):
        monkeypatch.delenv(name, raising=False)
    best = target.available()[0]
    assert machine()[0][2] == best
    assert machine(TSDYN_TARGET=target.available()[-1])[0][2] == target.available()[-1]
    assert machine(TSDYN_TARGET="native")[0][2] == backend.llvm.get_host_cpu_name()
    assert machine(NUMBA_CPU_NAME=best, NUMBA_CPU_FEATURES="")[0][1:] == [*target.of_numba()[:1], best, ""]
    assert machine(NUMBA_CPU_NAME=best, TSDYN_TARGET=best)[0] == machine()[0]
    found, errors = machine(TSDYN_TARGET="abacus")
    assert found[2] == best
    assert f"TSDYN_TARGET=abacus is ignored: this processor has {', '.join(target.available())}, native." in errors


@pytest.mark.parametrize(
    ("lacks", "found"),
    [((), ["x86-64-v3", "x86-64-v2"]), (("avx2",), ["x86-64-v2"]), (("fma",), ["x86-64-v2"]), (("sse4.2",), [])],
)
@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="instructions of x86-64")
def test_a_target_needs_its_instructions(monkeypatch, lacks, found):
    features = dict.fromkeys(target.PORTABLE["x86-64-v3"], True) | dict.fromkeys(lacks, False)
    monkeypatch.setattr(target.llvm, "get_host_cpu_features", lambda: features)
    assert target.available.__wrapped__() == found


@pytest.mark.slow
@own
@portable
def test_a_kernel_of_one_target_is_not_used_for_another(tmp_path):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path)}
    for name, misses in ((target.available()[0], 1), ("native", 1), (target.available()[0], 0)):
        found, _ = run(TINY, {**environment, "TSDYN_TARGET": name})
        assert (found["value"], found["misses"]) == (2.0, misses)


@own
def test_numba_compiles_for_users_as_ever():
    from numba.core.registry import cpu_target

    assert cpu_target.target_context.codegen().magic_tuple() == target.of_numba()[:3]


PRINTED = (
    REPORT
    + """
import ctypes, numba
from tsdyn.jit.kernels import Callback
@numba.njit
def halved(i):
    return 1 if i <= 1 else other(i // 2) + 1
@numba.njit
def other(i):
    return 1 if i <= 1 else halved(i // 2) + 1
@numba.njit
def ring(i):
    return halved(i)
@numba.njit
def said(i):
    print("said", i)
    return i
BEFORE
def law(i):
    return ring(i) + said(i)
call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(Callback(law, "i", allocates=True).address)
report(value=call(1000))
"""
)


@pytest.mark.slow
@own
@pytest.mark.parametrize("before", ["", "ring(3), said(3)"])
def test_users_functions_that_print_or_call_each_other_in_a_ring(tmp_path, before):
    """Numba compiles them for its own target, a kernel for the portable one calls them: 1000 is halved ten times."""
    for _ in range(2):
        found, errors = run(PRINTED.replace("BEFORE", before), {"NUMBA_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"})
        assert (found["value"], errors) == (1010, "")


BITS = (
    REPORT
    + """
import hashlib
from examples import slider_crank, stick_slip, top
bits = []
for method in ("taylor", "dop853", "rk45", "nystrom4", "radau", "sdirk54", "implicit_trapezoid"):
    options = {"integrator": tsdyn.integrators.Nystrom4(step=1e-3) if method == "nystrom4" else method}
    examples = (top, slider_crank) if method == "radau" else (top, slider_crank, stick_slip)  # it refuses friction
    found = [tsdyn.simulate(example.build(), (0.0, 0.1), **options) for example in examples]
    forms = ("null-space", "maggi-kane") if method in ("dop853", "rk45", "nystrom4") else ()
    found += [tsdyn.simulate(top.build(), (0.0, 0.1), formulation=form, **options) for form in forms]
    bits.append(hashlib.sha256(b"".join(one.q.tobytes() + one.multipliers.tobytes() for one in found)).hexdigest())
report(bits=bits)
"""
)


@own
@pytest.mark.slow
@pytest.mark.skipif(target.available()[:1] != ["x86-64-v3"], reason="needs a processor of x86-64-v3")
def test_the_machines_own_target_gives_the_same_bits():
    """All that is fused or reordered is so by tsdyn's own code, for both."""
    assert run(BITS, {"TSDYN_TARGET": "x86-64-v3"})[0]["bits"] == run(BITS, {"TSDYN_TARGET": "native"})[0]["bits"]
