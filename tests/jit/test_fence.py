"""Numba's private parts: each is as it was seen; where one is gone or fails, Numba as it comes gives the same bits."""

import gc
import inspect
import json
import os
import re

import llvmlite.binding
import numba
import pytest
from numba.core.itanium_mangler import mangle
from numba.extending import intrinsic

import tsdyn as ts
from tests.helpers.processes import REPORT, ROOT, SMALL, TINY, command, edit, run
from tsdyn.jit import backend, cache, compilers, stock, target
from tsdyn.jit.kernels import entry
from tsdyn.jit.resident import stack, zeros

VERSIONS = f"Numba {numba.__version__}; it was seen in {' to '.join(backend.SEEN)}"


@pytest.mark.parametrize("line", backend.PRIVATE.split("\n")[1:-1])
def test_what_is_private_is_as_it_was_seen(line):
    try:
        backend.demand(line)
    except ImportError as error:
        pytest.fail(f"tsdyn counts on {line} of numba.core, which isn't so in {VERSIONS}: {error}")


@pytest.mark.parametrize("line", ["compiler.Gone", "serialize.dumps(value)", "compiler.CompilerBase.__init__:gone"])
def test_what_has_changed_is_named(line):
    with pytest.raises(ImportError, match=re.escape(re.split(r"[(:]", line)[0])):
        backend.demand(line)


def test_callbacks_of_llvm_have_names_that_ctrl_c_knows():
    names = vars(llvmlite.binding.executionengine.ExecutionEngine)
    assert any(name.startswith(backend.CALLBACK_FRAMES) for name in names), (
        f"tsdyn counts on LLVM calling functions {backend.CALLBACK_FRAMES}* of llvmlite.binding.ExecutionEngine, in "
        f"which a Ctrl-C is lost and therefore deferred; llvmlite {llvmlite.__version__} has none"
    )


def test_numbers_in_names_are_found():
    name = mangle("numba.max", (numba.float64,), abi_tags=("flags",), uid=7)
    assert backend._NUMBERED.search(name), f"tsdyn counts on numbers in names of functions, {name} has none: {VERSIONS}"
    assert name.startswith(backend._NUMBA)
    assert not backend._NUMBERED.search(mangle("tsdyn.max", (numba.float64,), abi_tags=("flags",), uid="h7"))


def test_dispatchers_and_intrinsics_show_the_function_that_the_hash_follows():
    @numba.njit(boundscheck=True)
    def compiled(x):
        return x

    @intrinsic
    def made(typing, x):
        return x(x), None

    assert inspect.isfunction(compiled.py_func), f"tsdyn counts on `py_func` of what njit makes: {VERSIONS}"
    assert compiled.targetoptions["boundscheck"], f"tsdyn counts on `targetoptions` of what njit makes: {VERSIONS}"
    assert inspect.isfunction(made.__wrapped__), f"tsdyn counts on `__wrapped__` of what intrinsic makes: {VERSIONS}"
    assert inspect.isfunction(stack.__wrapped__)


@pytest.mark.skipif(compilers.current() is stock, reason="nothing private is used")
def test_stored_machine_code_has_the_shape_that_is_taken_apart(monkeypatch):
    seen = []
    monkeypatch.setattr(backend.KernelCache, "save_overload", lambda self, sig, data: seen.append(data._reduce()[0]))
    monkeypatch.setattr(cache, "load", lambda *_: None)
    backend.callback(lambda i: i + 1, numba.types.int64(numba.types.int64), {}, False)
    (found,) = seen
    assert [type(part) for part in found] == [str, str, tuple], (
        f"tsdyn counts on the first part of CompileResult._reduce() being (name, kind, (code, bitcode)): {VERSIONS}"
    )
    assert [type(part) for part in found[2]] == [bytes, bytes]


def test_the_native_processor_is_the_one_that_numba_compiles_for():
    from numba.core.registry import cpu_target

    found = cpu_target.target_context.codegen().magic_tuple()
    assert target.of_numba() == found, f"tsdyn counts on Numba compiling for LLVM's host processor: {VERSIONS}"


GONE = {
    "a pass": "from numba.core import untyped_passes; del untyped_passes.WithLifting",
    "a class": "from numba.core import codegen; del codegen.JITCodeLibrary",
    "a module": "import sys, numba; sys.modules['numba.core.compiler_machinery'] = None",
    "an option": "from numba.core import options; del options.DefaultOptions._nrt",
    "another signature": """
from numba.core.compiler_machinery import PassManager
add = PassManager.add_pass
PassManager.add_pass = lambda self, kind, what='': add(self, kind, what)
""",
    "a method that fails when it is used": """
from numba.core.compiler import CompileResult
replace = CompileResult._replace
def refuse(self, **given):
    if "type_annotation" in given:
        raise TypeError("no such field: type_annotation")
    return replace(self, **given)
CompileResult._replace = refuse
""",
    "a test that gives another number": """
import ctypes
kind = ctypes.CFUNCTYPE
ctypes.CFUNCTYPE = lambda *types: (lambda address: lambda i: 40) if types == (ctypes.c_int64,) * 2 else kind(*types)
""",
}


@pytest.mark.skipif(compilers.current() is stock, reason="nothing private is used")
@pytest.mark.slow_but("a pass")
@pytest.mark.parametrize("gone", GONE)
def test_where_something_is_gone_numba_as_it_comes_serves(gone, tmp_path):
    """With one warning; parts that are used by compilation alone need an empty cache."""
    code = TINY if " that " in gone else SMALL
    found, errors = run(GONE[gone] + code, {"TSDYN_CACHE_DIR": str(tmp_path)} if " that " in gone else {})
    assert found.get("value", 2.0) == 2.0
    assert found.get("Phi", 0.0) == 0.0
    assert errors.count("CompilerWarning: Numba") == 1
    assert "Results are the same to the bit" in errors


def refuse():
    raise TypeError("no such field")


def test_a_failure_in_a_run_has_numba_as_it_comes_serve_from_then_on(monkeypatch):
    monkeypatch.setattr(compilers, "_chosen", [backend])
    monkeypatch.setattr(backend, "tested", lambda own: own())
    with pytest.warns(ts.CompilerWarning, match=r"TypeError: no such field"):
        assert compilers.attempt(zeros, refuse, lambda: 3) == 3
    assert compilers.current() is stock
    assert compilers.attempt(zeros, refuse, lambda: 4) == 4


def test_code_that_no_way_compiles_is_an_error_of_the_code(monkeypatch):
    monkeypatch.setattr(compilers, "_chosen", [backend])
    monkeypatch.setattr(backend, "tested", lambda own: own())
    with pytest.raises(TypeError, match="no such field"):
        compilers.attempt(zeros, refuse, lambda: 1 / 0)
    assert compilers.current() is backend


@pytest.mark.slow
def test_stock_is_asked_for_without_a_warning(tmp_path):
    environment = {"TSDYN_JIT": "stock", "TSDYN_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"}
    for misses in (1, 0):
        found, errors = run(TINY, environment)
        assert (found["value"], found["misses"], errors) == (2.0, misses, "")
    assert not list(tmp_path.rglob("*.kernel"))


@pytest.mark.slow
def test_a_damaged_file_of_numba_is_told_and_compiled_again(tmp_path):
    environment = {"TSDYN_JIT": "stock", "TSDYN_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"}
    run(TINY, environment)
    for suffix in ("nbi", "nbc"):
        (file,) = tmp_path.rglob(f"*.{suffix}")
        file.write_bytes(file.read_bytes()[:20])
        found, errors = run(TINY, environment)
        assert (found["value"], found["misses"]) == (2.0, 1)
        assert errors.count("a stored kernel can't be loaded") == 1
        assert run(TINY, environment)[0]["misses"] == 0


@pytest.mark.slow
def test_an_unknown_way_is_told(tmp_path):
    found, errors = run(TINY, {"TSDYN_JIT": "stok"})
    assert found["value"] == 2.0
    assert errors.count("TSDYN_JIT=stok is unknown") == 1


@pytest.mark.slow
def test_numba_as_it_comes_is_never_stale(package):
    """Numba alone would answer the edit of a callee in another file with stale code."""
    (package / "tsdyn" / "inner.py").write_text(
        "from .jit.kernels import kernel\nLEVEL = 3.0\n@kernel\ndef level(x):\n    return LEVEL * x\n"
    )
    (package / "tsdyn" / "outer.py").write_text(
        "from .jit.kernels import entry\nfrom . import inner\n@entry\ndef twice(x):\n    return 2.0 * inner.level(x)\n"
    )
    environment = {"NUMBA_CACHE_DIR": str(package / "cache"), "TSDYN_JIT": "stock"}
    code = REPORT + "\nfrom tsdyn.outer import twice\nreport(value=twice(1.0))\n"
    for value, misses in ((6.0, 1), (6.0, 0)):
        found, _ = run(code, environment, package)
        assert (found["value"], found["misses"]) == (value, misses)
    edit(package / "tsdyn" / "inner.py", "3.0", "5.0")
    found, _ = run(code, environment, package)
    assert (found["value"], found["misses"]) == (10.0, 1)


BITS = (
    REPORT
    + """
import hashlib
import numpy as np
import tsdyn as ts
from benchmarks.stiff import jointed
from examples import top
found = [ts.simulate(top.build(), (0.0, 0.05), integrator=name) for name in ("taylor", "dop853", "radau")]
for form in ("null-space", "maggi-kane"):
    found.append(ts.simulate(top.build(), (0.0, 0.05), integrator="rk45", formulation=form))
found.append(ts.simulate(jointed(), (0.0, 0.05), integrator="implicittrapezoid"))
scene = top.build()
mass = next(name for name in scene.parameters() if name.endswith("mass"))
cases = {mass: scene.parameters()[mass] * np.array([1.0, 1.1, 1.2, 1.3])}
study = ts.ensemble(scene, cases, (0.0, 0.05), lanes=4)
bits = [hashlib.sha256(one.q.tobytes() + one.multipliers.tobytes()).hexdigest() for one in found]
report(bits=[*bits, hashlib.sha256(study.q.tobytes()).hexdigest()], lanes=study.lanes)
"""
)


@pytest.mark.slow
def test_both_ways_give_the_same_bits():
    """Explicit and implicit methods, Taylor, the other forms, and lanes."""
    own, _ = run(BITS, {})
    other, errors = run(BITS, {"TSDYN_JIT": "stock"})
    assert own["bits"] == other["bits"]
    assert own["lanes"] == other["lanes"] == 4
    assert "CompilerWarning" not in errors


@pytest.mark.slow
@pytest.mark.parametrize("file", ["lanes", "simd", "resident", "backend", "stock"])
def test_an_edit_of_code_generation_names_other_kernels(package, file):
    """Types and their lowering are named by no function."""
    code = "from tsdyn.jit.code_hash import platform_hash\n"
    code = "import json\n" + code + 'print(json.dumps({"hash": platform_hash()}))\n'
    before, _ = run(code, {}, package)
    path = package / "tsdyn" / "jit" / f"{file}.py"
    path.write_text(path.read_text() + "\nNOTHING = 0\n")
    assert run(code, {}, package)[0]["hash"] != before["hash"]


MINE = """
from numba import types
from numba.extending import models, register_model

class Mine(types.Type):
    def __init__(self):
        super().__init__("Mine")

register_model(Mine)(models.OpaqueModel)
mine = Mine()

def of_a_class(x):
    return Mine

def of_a_type(x):
    return mine
"""


@pytest.mark.slow
def test_an_edit_beside_a_type_of_a_user_names_other_kernels(tmp_path):
    """Its model is registered beside it."""
    file, environment = tmp_path / "user_types.py", {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    file.write_text(MINE)
    code = "import json, user_types\nfrom tsdyn.jit.code_hash import deep_hash\n"
    code += "print(json.dumps({f: deep_hash(getattr(user_types, f)) for f in ('of_a_class', 'of_a_type')}))\n"
    before, _ = run(code, environment)
    edit(file, "models.OpaqueModel", "models.PointerModel")
    after, _ = run(code, environment)
    assert before["of_a_class"] != after["of_a_class"]
    assert before["of_a_type"] != after["of_a_type"]


INFO = """
from tsdyn.cli import main
assert main(["info", "--cache", "--json"]) == 0
"""


@pytest.mark.slow
@pytest.mark.skipif(compilers.current() is stock, reason="Numba's own cache has other files")
def test_a_kernel_that_cannot_be_loaded_is_told_and_counted(tmp_path):
    environment = {"TSDYN_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"}
    run(TINY, environment)
    (file,) = tmp_path.rglob("*.kernel")
    file.write_bytes(file.read_bytes()[:-9] + bytes(9))
    found = information(environment)
    assert (found["kernels"], [name for name, _ in found["damaged"]], found["failures"]) == (0, [file.name], [])
    mended, errors = run(TINY, environment)
    assert (mended["value"], mended["damaged"], mended["misses"]) == (2.0, 1, 1)
    assert errors.count("a stored kernel can't be loaded") == 1
    assert "the checksum is wrong" in errors
    found = information(environment)
    assert (found["kernels"], found["damaged"], len(found["failures"])) == (1, [], 1)
    assert file.name in found["failures"][0]


def information(environment):
    """What `tsdyn info --cache` prints."""
    process = command(INFO, environment, ROOT)
    out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return json.loads(out)


@pytest.mark.skipif(compilers.current() is stock, reason="the cache is Numba's own")
def test_no_garbage_is_collected_while_a_kernel_is_compiled(monkeypatch):
    enabled, save = [], backend.KernelCache.save_overload
    monkeypatch.setattr(backend.KernelCache, "save_overload", lambda *a: enabled.append(gc.isenabled()) or save(*a))
    monkeypatch.setattr(cache, "load", lambda *a: None)  # compiled whether or not it is stored

    @entry
    def thrice(x):
        return 3.0 * x

    assert thrice(1.5) == 4.5
    assert enabled
    assert not any(enabled)  # of the self-test, too
    assert gc.isenabled()
