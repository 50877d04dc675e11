"""Kernels compiled before they are needed, by several processes at a time.

Everything works without it, but a first run takes longer. `prepare_first_run` says which kernels a run needs,
`compile_kernels` those of `tsdyn compile`, `ship` those of a wheel; `compile_ahead` starts the processes that fill the
cache on disk.
"""

import contextlib
import functools
import json
import multiprocessing
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
from importlib import import_module
from pathlib import Path

from .configuration import initial_conditions
from .elements import force, primitive
from .elements.laws import SceneLaw
from .errors import TsdynError
from .formulations.registry import FORMULATIONS
from .integrators import DOP853, Taylor
from .jit import cache, compilers, stock
from .jit.code_hash import is_ours, versions
from .jit.compiled import DEBUG, is_declared, is_loaded, is_stored, load, signature_of
from .jit.interrupts import Waiting
from .jit.target import available, portable
from .methods.explicit import called_for
from .model.equations import evaluate_constraints, is_of_user, second_derivatives
from .model.handles import has_rates
from .motions import program, tracing
from .motions.signals import Signal
from .rows.interface import ELIMINATION
from .runs.run_memory import advance_run
from .runs.step_control import watch
from .runs.step_engine import second_derivative
from .runs.stepper import advance
from .runs.task import adaptive
from .taylor import step_parts
from .taylor.layout import FAR, no_series, pays, room
from .taylor.series_engine import accelerating, expanding
from .taylor.stepper import advance_series

# Which kernels a run needs, so that a first one can have them compiled at the same time.

# What this process has made sure of: method, form, whether there is anything between steps, friction; for which classes
# of constraints and forces
_known = {}


def prepare_first_run(scene, method, form, within, default):
    """Have compiled what a run of the scene needs, if any of it is missing on disk.

    method may be None: `default` is then (rtol, atol, whether Taylor may be chosen). within: whether anything is asked
    for between the steps.
    """
    packed = scene._packed
    rough = packed.system.normals.size > 0 if packed is not None else _is_rough(scene)
    key = type(method), form.name, form.is_mixed(has_rates(scene)), within, rough
    if DEBUG or not scene.bodies:
        return
    # A packed scene has its kernels; a phase adds rows and forces to the parts of a scene, which has them
    kinds = set() if packed is not None else {type(part) for part in (*scene._added, *scene._forces)}
    if key in _known and (packed is not None or (scene._whole is not None and kinds <= _known[key])):
        return
    compile_ahead(kernels_of(scene, method or _default_method(scene, *default), form, within))
    _known[key] = _known.get(key, set()) | kinds


def kernels_of(scene, method, form, within):
    """The kernels that a run of the scene needs, as the keys of a dict; arguments as of `prepare_first_run`."""
    rough, form = _is_rough(scene), form.serving(method, has_rates(scene))
    far = isinstance(method, Taylor) and len(scene.bodies) * room(method.orders()[2]) > FAR
    return dict.fromkeys([*of_scene(scene, method, form, far, rough), *of_method(method, form, within, far, rough)])


def _is_rough(scene):
    """Whether there is joint friction."""
    return any("normal_load" in force.kernels for force in scene.forces)


def of_scene(scene, method, form, far, rough):
    """The kernels of constraints and forces, far and rough as of `of_method`, and those for several rows."""
    series, implicit = isinstance(method, Taylor), method.implicit
    if implicit or sum(one.all_rows for one in scene.primitives if not one.normalises) > 1:
        yield from ELIMINATION["symmetric"]
        if rough or not series:
            yield from ELIMINATION["unsymmetric"]
    for kind, moving in _kinds(scene).items():
        second = second_derivatives(form.basis_free) if implicit else ()
        yield from of_constraint(kind, moving, series, far, second, _is_grounded(scene, kind))
    if not series and any(map(is_of_user, scene.forces)):
        yield watch
    if series and any(map(_is_checked, scene.forces)):
        yield step_parts.check_laws
    for item in scene.forces:
        signals = [value for value in vars(item).values() if isinstance(value, Signal)]
        yield from of_force(item.kernels, series, implicit, form, "driven_" * bool(signals))
        if series and (hasattr(item.kernels, "program") or isinstance(item, SceneLaw)):
            yield tracing.run_order
        if signals and (series or any(signal.motions for signal in signals)):
            yield program.run_program


def of_constraint(kind, moving, series=True, far=False, second=(), grounded=False):
    """The loops over constraints of a class.

    moving: whether one of them depends on time; second: derivatives; grounded: whether all touch the ground.
    """
    names = ["phi", "jacobian", "gamma", *["phi_t"] * moving, *["remember"] * bool(kind.memory)]
    if not kind.normalises:
        names += ["reduced", "values", "bias", *["drift"] * moving]
        names += ["contact_rows", "contact_series"] * series
        names += ["far_" * far + "driven_" * moving + "series"] * (series and not grounded)
    names += second
    return [kind.kernels[name] for name in names if name in kind.kernels]


def of_force(kernels, series=True, implicit=False, form=FORMULATIONS["tangent"], driven=""):
    """The loops over forces that have these kernels; driven: "driven_" for the series of those with loads of time."""
    names = ["force", "remember", "normal_load", "unit_friction", *["jacobian"] * implicit]
    names += [driven + "series", driven + "check", driven + "margin", "load_slope"] * series
    found = [kernels[name] for name in names if name in kernels]
    if "normal_load" in kernels and not series:
        found.append(form.friction_solver)
    return found


def of_method(method, form, within, far=False, rough=False):
    """The kernels of a start, of the method and of the form.

    far: of series that are too long for caches near by; rough: of a scene with joint friction.
    """
    yield from (evaluate_constraints, initial_conditions.evaluate_start, advance_run)
    if isinstance(method, Taylor):
        yield from (expanding(rough, far), step_parts.reach, advance_series)
        yield from (accelerating(rough), step_parts.pass_singular) if within else ()
        return
    kernels = form.kernels
    yield from (kernels.place, kernels.accelerate, kernels.complete)
    yield from (kernels.check, kernels.start_chart, advance)
    if method.driver == "steps":
        yield from filter(None, called_for(method.kernel(form.first_order)[0]))
        yield from form.stage_kernels(form.frees_stages)
    if method.step is None:
        yield from method.errors
    if method.implicit:
        yield from form.stages(method.coupled > 0).values()
    if within:
        interpolant = method.interpolant(form.first_order)
        yield from (interpolant.fill, interpolant.value)
        yield from (kernels.normal,) if form.has_normals else ()
        yield from filter(None, (second_derivative(method, form),))


def _is_checked(force):
    """Whether series of a force may differ from its law."""
    sharp = force.sharp or any(isinstance(value, Signal) and not value.entire for value in vars(force).values())
    return sharp or force.positive != () or getattr(force, "checked", False)


def _kinds(scene):
    """{class of constraint: whether one of them moves}."""
    kinds = {}
    for constraint in scene.primitives:
        kind = type(constraint)
        kinds[kind] = kinds.get(kind, False) or constraint.rheonomic
    return kinds


def _is_grounded(scene, kind):
    """Whether all constraints of a class are contacts with the ground."""
    return bool(kind.normal) and all(one.b is scene.ground for one in scene.primitives if type(one) is kind)


def _default_method(scene, rtol, atol, series):
    """The explicit method that the default will find to begin with."""
    kinds = (kind.kernels for kind in _kinds(scene) if not kind.normalises)
    series = series and all("series" in kernels for kernels in kinds) and pays(scene.primitives, scene.forces)
    series = series and not any(no_series(force, force.parameters()) for force in scene.forces)
    return adaptive(Taylor if series else DOP853, rtol, atol)


# Kernels compiled ahead of a first run, by as many processes at a time as there are processors.
#
# The processes fill the cache on disk. What they can't compile, for whatever reason, is compiled here when
# it is needed, as if there were none of them: they make a first run faster, and nothing depends on them.

MOST = 16  # processes: each takes some 300 MB
_turn = threading.Lock()


def compile_ahead(kernels, asked=False):
    """Compile those of tsdyn's own kernels that are neither loaded nor stored; returns {name: why not} of failures.

    asked: whether somebody waits for nothing else.
    """
    if DEBUG:
        return {}
    with _turn:  # threads that begin together
        ours = [kernel for kernel in kernels if not is_loaded(kernel) and is_ours(kernel.py_func.__module__)]
        missing = {name: kernel for kernel in ours if not is_stored(kernel) and (name := name_of(kernel))}
        if not missing:
            return {}
        order = sorted(missing, key=lambda name: -weight(missing[name].py_func))
        with Waiting(len(order), asked) as waiting:
            done, failed = {}, {}
            count = min(processors(), len(order), MOST)
            if count > 1 and _may_start() and cache.folder() is not None:
                done = _in_processes(order, count, waiting)
            waiting.now.clear()
            for name in (name for name in order if done.get(name) != ""):
                waiting.begin(name)
                try:
                    load(missing[name])
                except Exception as error:  # it will be met again, where it is needed
                    failed[name] = f"{type(error).__name__}: {error}"
                waiting.end(name, name not in failed)
            return failed


def name_of(kernel):
    """Module and name by which another process finds the kernel; empty where none can."""
    function = kernel.py_func
    module, name = function.__module__ or "", function.__qualname__
    return f"{module} {name}" if find(module, name) is kernel else ""


def weight(function):
    """About how long the function takes to compile: bytes of code of all that it calls, each function once."""
    seen, total, further = {function}, 0, [function]
    while further:
        one = further.pop()
        total += len(one.__code__.co_code)
        for name in one.__code__.co_names:
            callee = getattr(one.__globals__.get(name), "py_func", None)
            if callee is not None and callee not in seen:
                seen.add(callee)
                further.append(callee)
    return total


def processors():
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _may_start():
    """Whether a process can be started that is Python, and is not one of many already."""
    alone = multiprocessing.parent_process() is None and "TSDYN_WORKER" not in os.environ
    return alone and bool(sys.executable) and not getattr(sys, "frozen", False)


def _in_processes(order, count, waiting):
    """Compile the kernels of these names; returns {name: "" or why not} of those that were answered."""
    tasks, answers = queue.SimpleQueue(), queue.SimpleQueue()
    for name in order:
        tasks.put(name)
    workers = []
    try:
        for _ in range(count):
            try:
                workers.append(_start())
            except OSError:  # no more processes, or no memory
                break
        for worker in workers:
            threading.Thread(target=_serve, args=(worker, tasks, answers), daemon=True).start()
        done, serving = {}, len(workers)
        while serving:
            try:
                what, name, problem = answers.get(timeout=0.2)
            except queue.Empty:
                waiting.show()
                continue
            if what == "begun":
                waiting.begin(name)
            elif what == "done":
                done[name] = problem
                waiting.end(name, not problem)
            else:
                serving -= 1
        return done
    finally:
        for worker in workers:
            worker.kill()
        for worker in workers:
            worker.wait()
            for pipe in (worker.stdin, worker.stdout):
                with contextlib.suppress(OSError):  # what was to be written still
                    pipe.close()
            cache.remove_partial_files(worker.pid)


def _start():
    """The same Python on this tsdyn, wherever it was imported from; of the user's program nothing is imported."""
    paths = [str(Path(__file__).parents[1]), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(path for path in paths if path),
        **cache.environment(),
        "TSDYN_JIT": "stock" if compilers.current() is stock else "",
        "TSDYN_QUIET": "1",
        "TSDYN_WORKER": "1",
    }
    return subprocess.Popen(
        [sys.executable, "-P", "-c", f"from {__name__} import work; work()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        text=True,
    )


def _serve(worker, tasks, answers):
    """Hand tasks to a worker, one after the other, until there are none or it is gone."""
    try:
        while True:
            name = tasks.get_nowait()
            answers.put(("begun", name, ""))
            worker.stdin.write(f"{name}\n")
            worker.stdin.flush()
            line = worker.stdout.readline()
            if not line.endswith("\n"):
                break
            answers.put(("done", name, line.strip()))
    except (queue.Empty, OSError, ValueError):  # done; or the worker has ended
        pass
    finally:
        answers.put(("left", "", ""))


# A process that compiles kernels for another one.
#
# It reads a kernel a line, module and name, compiles it into the cache on disk, and answers with a line: nothing, or
# why not. It ends when there is nothing more to read.


def find(module, name):
    """The kernel of this module and name, of tsdyn's own; None where there is none."""
    if not is_ours(module):
        return None
    found = _loops().get((module, name)) or getattr(import_module(module), name, None)
    return found if is_declared(found) else None


@functools.cache
def _loops():
    """{(module, name): kernel} of constraints and forces."""
    kernels = [kernel for kind in _built_in() for kernel in _loops_of(kind).values()]
    return {(kernel.py_func.__module__, kernel.py_func.__qualname__): kernel for kernel in kernels}


def work():
    """Compile what is asked for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started this one
    answers, sys.stdout = sys.stdout, sys.stderr
    for line in sys.stdin:
        problem = ""
        try:
            load(find(*line.split()))
        except Exception as error:
            problem = f"{type(error).__name__}: {error}".splitlines()[0]
        print(problem, file=answers, flush=True)


# The kernels that `tsdyn compile` compiles: all that a first run may need, or all that there are.


def compile_kernels(everything=False):
    """Compile what the default method needs for any built-in constraint and force, or all kernels there are.

    Contacts, impacts and exact friction are among the former.

    Returns how many there are, the folder that has them, and {name: problem} of those that it has not.
    """
    if DEBUG:
        return 0, None, {"everything": "TSDYN_DEBUG is set, so nothing is compiled"}
    names = named(everything)
    if cache.folder() is None:
        return len(names), None, {"everything": "no folder can be written to; set TSDYN_CACHE_DIR to one"}
    failed = compile_ahead(names.values(), asked=True)
    absent = {name: "the file could not be written" for name, kernel in names.items() if not is_stored(kernel)}
    return len(names), cache.folder(), absent | failed


def named(everything):
    """The kernels, by the names that other processes know them by."""
    return {name: kernel for kernel in (_all() if everything else _default()) if (name := name_of(kernel))}


# Packages whose kernels are of a method, of a form or of a check. Those of all others are compiled, so that none that a
# run may need is forgotten; of these, and of constraints and forces, what the default method calls.
OF_CHOICE = "formulations", "methods", "measuring", "testing"


def _default():
    form, modules = FORMULATIONS["tangent"], list(_of_modules())
    for rough in (False, True):
        yield from of_method(Taylor(1e-8), form, True, rough=rough)
    yield from of_method(DOP853(1e-8, 1e-8), form, True)
    yield form.friction_solver
    for kind in _built_in():
        if issubclass(kind, primitive.Primitive):
            for moving in (False, *[True] * ("phi_t" in kind.kernels)):
                yield from of_constraint(kind, moving)
        else:
            for driven in ("", "driven_"):
                yield from of_force(kind.own_kernels, driven=driven)
    yield from (kernel for kernel in modules if kernel.py_func.__module__.split(".")[1] not in OF_CHOICE)


def _all():
    modules = list(_of_modules())
    for kind in _built_in():
        yield from _loops_of(kind).values()
    yield from modules


def _of_modules():
    """The kernels of all modules, which are imported; not those of classes."""
    home = Path(__file__).parent
    for file in home.rglob("*.py"):
        if not file.stem.startswith("__"):
            with contextlib.suppress(ModuleNotFoundError):  # an optional package's
                import_module(".".join((home.name, *file.relative_to(home).with_suffix("").parts)))
    for module in [value for name, value in sys.modules.items() if is_ours(name)]:
        yield from filter(is_declared, vars(module).values())


def _built_in():
    """The package's own classes of constraints and forces, those that others choose for themselves among them."""
    further, found = [primitive.Primitive, force.Force], []
    while further:
        kinds = further.pop().__subclasses__()
        further += kinds
        found += [kind for kind in kinds if is_ours(kind.__module__)]
    return dict.fromkeys(found)


def _loops_of(kind):
    return getattr(kind, "own_kernels", kind.kernels)


# Kernels for a platform wheel, which setup.py builds.
#
# A folder for each portable target that this processor has, or for that of TSDYN_TARGET alone: all of tsdyn's own
# kernels as the cache on disk has them, those of the self-tests, and the versions that compiled them.


def _ship_target(folder):
    """Fill the folder with the kernels of this process's target.

    Raises
    ------
    TsdynError
        If the target is not portable, or a kernel can't be compiled.
    """
    if compilers.CHOICE or not portable():
        raise TsdynError(
            f"Kernels are shipped for a portable target, of which this processor has {available() or 'none'}: unset "
            "TSDYN_JIT and NUMBA_CPU_NAME, and give such a target, or nothing, as TSDYN_TARGET."
        )
    _, _, failed = compile_kernels(everything=True)
    if failed:
        raise TsdynError(f"Kernels can't be shipped, since some can't be compiled: {failed}.")
    backend = compilers.current()
    backend.compile_probes()
    home = Path(folder) / portable()
    home.mkdir(parents=True, exist_ok=True)
    kernels = [backend.stored_file(kernel.py_func, signature_of(kernel)) for kernel in named(everything=True).values()]
    for file in (*kernels, *backend.probe_files()):
        shutil.copyfile(file, home / file.name)
    (home / backend.MADE).write_text(json.dumps(versions()), encoding="utf-8")


def ship(folder):
    """Ship the kernels of every target, each from a process of its own."""
    if "TSDYN_TARGET" in os.environ or not available():
        return _ship_target(folder)
    for name in available():
        environment = {**os.environ, "TSDYN_TARGET": name}
        subprocess.run(
            [sys.executable, "-c", f"import sys; from {__name__} import ship; ship(sys.argv[1])", folder],
            env=environment,
            check=True,
        )
