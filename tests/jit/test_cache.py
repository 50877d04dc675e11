"""The kernel cache on disk: damaged files, full disks, read-only folders, processes that start together, Ctrl-C."""

import os
import shutil
import sys
from pathlib import Path

import numba
import pytest

import tsdyn
from tests.helpers.processes import KERNELS, REPORT, SMALL, TINY, command, finish, run
from tsdyn.jit import compilers, stock

ROOT = Path(__file__).parents[2]
own = pytest.mark.skipif(compilers.current() is stock, reason="Numba's own cache has other files")
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX file permissions, limits or locks")


@pytest.mark.slow
def test_first_compilation_is_announced_once(tmp_path):
    result, errors = run(SMALL, {"NUMBA_CACHE_DIR": str(tmp_path)})
    assert result["misses"] == KERNELS
    assert errors.count("compiling kernels") == 1


@own
@pytest.mark.slow_but("<lambda>0")
@pytest.mark.parametrize("damage", [lambda b: b[: len(b) // 2], lambda b: b"", lambda b: b[:-9] + b"\0" * 9])
def test_damaged_kernels_are_compiled_anew(tmp_path, damage):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path)}
    run(TINY, environment)
    (file,) = tmp_path.rglob("*.kernel")
    file.write_bytes(damage(file.read_bytes()))
    mended, _ = run(TINY, environment)
    assert (mended["value"], mended["damaged"], mended["misses"]) == (2.0, 1, 1)
    again, _ = run(TINY, environment)
    assert (again.get("damaged", 0), again["misses"]) == (0, 0)


@pytest.mark.slow
@posix
def test_full_disk_costs_a_warning_and_not_the_run(tmp_path):
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
    result, errors = run(full + TINY, {"NUMBA_CACHE_DIR": str(tmp_path)})
    assert (result["value"], result["misses"]) == (2.0, 1)
    assert errors.count("so every process compiles them again") == 1
    assert not [file for file in Path(result["folder"]).iterdir() if file.suffix != ".lock"]


WITHOUT_PRIVILEGE = ["setpriv", "--bounding-set=-dac_override,-dac_read_search"]  # root heeds permissions, too


@pytest.mark.slow
@posix
def test_complete_cache_that_can_not_be_written_is_used(tmp_path):
    as_root = hasattr(os, "getuid") and os.getuid() == 0
    if as_root and not shutil.which("setpriv"):
        pytest.skip("root writes everywhere")
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "kept"), "TMPDIR": str(scratch)}
    folder = Path(run(TINY, environment)[0]["folder"])
    for path in (folder, folder.parent, folder.parent.parent):
        path.chmod(0o555)
    process = command(TINY, environment, ROOT, before=WITHOUT_PRIVILEGE if as_root else ())
    found, errors = finish(process)
    assert (found["value"], found["misses"]) == (2.0, 0)
    assert Path(found["folder"]).is_relative_to(scratch)
    assert errors == ""


INTERRUPTED = """
import signal
from numba.core.registry import cpu_target
from tsdyn.jit.kernels import entry
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
engine = cpu_target.target_context.codegen()._engine._ee
found = engine._object_cache_notify
def notify(*arguments):
    signal.raise_signal(signal.SIGINT)
    found(*arguments)
engine._object_cache_notify = notify
@entry
def twice(x):
    return 2.0 * x
try:
    twice(1.0)
except KeyboardInterrupt:
    print("interrupted")
engine._object_cache_notify = found
print(twice(1.0), signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


@pytest.mark.slow
def test_interrupt_while_llvm_works_is_a_keyboard_interrupt(tmp_path):
    process = command(INTERRUPTED, {"NUMBA_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"}, ROOT)
    assert process.communicate(timeout=300) == ("interrupted\n2.0 True\n", "")


@pytest.mark.slow
@posix
def test_no_writable_home_falls_back_to_the_temporary_folder(package):
    blocked = package / "file"
    blocked.touch()
    scratch = package / "scratch"
    scratch.mkdir()
    environment = {"HOME": str(blocked), "XDG_CACHE_HOME": "", "TMPDIR": str(scratch)}
    for folder in ("tsdyn", "constraints", "integrators"):
        (package / folder).chmod(0o555)
    first, _ = run(SMALL, environment, package)
    second, _ = run(SMALL, environment, package)
    assert first["folder"].startswith(str(scratch))
    assert (first["misses"], second["misses"]) == (KERNELS, 0)


@pytest.mark.slow
@posix
def test_processes_starting_together_compile_once(tmp_path):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path)}
    results = [finish(process)[0] for process in [command(SMALL, environment, ROOT) for _ in range(3)]]
    assert {result["Phi"] for result in results} == {0.0}
    assert sum(result["misses"] for result in results) == KERNELS


@pytest.mark.slow
@own
def test_kernels_without_readable_source_are_stored(package):
    """Generated functions have the lines of a template in another file, which newer versions of Python don't read."""
    (package / "generated.py").write_text(
        "import inspect, tokenize\n"
        "from tsdyn.jit.kernels import entry\n"
        "def unreadable(function):\n"
        "    raise tokenize.TokenError('EOF in multi-line string', (1, 1))\n"
        "inspect.getsourcelines = unreadable\n"
        "@entry\n"
        "def half(x):\n"
        "    return 0.5 * x\n"
    )
    environment = {"NUMBA_CACHE_DIR": str(package / "cache")}
    code = REPORT + "\nfrom generated import half\nreport(value=half(3.0))\n"
    for misses in (1, 0):
        found, _ = run(code, environment, package)
        assert (found["value"], found["misses"]) == (1.5, misses)


def test_numba_settings_are_left_alone():
    from numba.core.caching import CacheImpl, _CacheLocator

    assert tsdyn.__version__
    assert all(locator.__module__ == _CacheLocator.__module__ for locator in CacheImpl._locator_classes)
    assert os.environ.get("NUMBA_CACHE_LOCATOR_CLASSES", "") == numba.config.CACHE_LOCATOR_CLASSES


TWO = (
    TINY
    + """
@entry
def thrice(x):
    return 3.0 * x
print(thrice(1.0), file=__import__("sys").stderr)
"""
)


@pytest.mark.slow
@own
def test_a_kernel_under_the_name_of_another_is_compiled_again(tmp_path):
    environment = {"TSDYN_CACHE_DIR": str(tmp_path), "TSDYN_QUIET": "1"}
    run(TWO, environment)
    one, other = sorted(tmp_path.rglob("*.kernel"))
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)
    mended, errors = run(TWO, environment)
    assert (mended["value"], mended["damaged"], mended["misses"]) == (2.0, 1, 1)
    assert errors.count("under the name of another") == 1
    assert errors.endswith("3.0\n")


@pytest.mark.slow
@own
def test_a_kernel_whose_module_has_moved_is_compiled_without_a_warning(tmp_path):
    environment = {"TSDYN_CACHE_DIR": str(tmp_path / "kernels")}
    source = "from tsdyn.jit.kernels import entry\n@entry\ndef twice(x):\n    return 2.0 * x\n"
    found = []
    for package in ("before", "after"):
        home = tmp_path / package / package
        home.mkdir(parents=True)
        (home / "twice.py").write_text(source)
        code = f"{REPORT}from {package}.twice import twice\nreport(value=twice(1.0))\n"
        result, errors = run(code, environment, home.parent)
        found.append((result["value"], result.get("damaged", 0), result["misses"], "can't be loaded" in errors))
    assert found == [(2.0, 0, 1, False)] * 2


@pytest.mark.slow
@own
def test_a_kernel_whose_callee_has_moved_is_compiled_without_a_warning(tmp_path):
    environment = {"TSDYN_CACHE_DIR": str(tmp_path / "kernels")}
    home, found = tmp_path / "home", []
    home.mkdir()
    for module in ("before", "after"):
        (home / f"{module}.py").write_text(
            "from tsdyn.jit.kernels import kernel\n@kernel\ndef level(x):\n    return 3.0 * x\n"
        )
        (home / "outer.py").write_text(
            f"from tsdyn.jit.kernels import entry\nfrom {module} import level\n"
            "@entry\ndef twice(x):\n    return 2.0 * level(x)\n"
        )
        result, errors = run(f"{REPORT}from outer import twice\nreport(value=twice(1.0))\n", environment, home)
        (home / f"{module}.py").unlink()
        found.append((result["value"], result.get("damaged", 0), result["misses"], "can't be loaded" in errors))
    assert found == [(6.0, 0, 1, False)] * 2


@pytest.mark.slow_for("above")
@posix
@pytest.mark.parametrize("which", ["kernels", "above"])
def test_folders_that_others_can_write_to_are_refused(which, tmp_path):
    folder = tmp_path / "above" / "kernels"
    folder.mkdir(parents=True)
    {"kernels": folder, "above": folder.parent}[which].chmod(0o777)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    environment = {"TSDYN_CACHE_DIR": str(folder), "TSDYN_QUIET": "1", "TMPDIR": str(scratch)}
    found, errors = run(TINY, environment)
    assert found["value"] == 2.0
    assert Path(found["folder"]).is_relative_to(scratch)
    assert "others than you can write" in errors
