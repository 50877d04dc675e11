"""Kernels compiled ahead of a first run, by as many processes at a time as there are processors.

The processes (worker.py) fill the cache on disk. What they can't compile, for whatever reason, is compiled here when it
is needed, as if there were none of them: they make a first run faster, and nothing depends on them.
"""

import contextlib
import multiprocessing
import os
import queue
import subprocess
import sys
import threading
from pathlib import Path

from ..jit import cache, compilers, stock
from ..jit.code_hash import is_ours
from ..jit.compiled import DEBUG, is_loaded, is_stored, load
from ..jit.interrupts import Waiting
from .worker import find

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
    paths = [str(Path(__file__).parents[2]), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(path for path in paths if path),
        **cache.environment(),
        "TSDYN_JIT": "stock" if compilers.current() is stock else "",
        "TSDYN_QUIET": "1",
        "TSDYN_WORKER": "1",
    }
    return subprocess.Popen(
        [sys.executable, "-P", "-m", f"{__package__}.worker"],
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
