"""Ctrl-C while a kernel compiles, while files are written, and within a long call; the line that counts kernels."""

import contextlib
import gc
import os
import shutil
import signal
import sys
import threading
import time
from concurrent.futures import Future, wait

from . import cache

# The line on stderr that counts kernels while a first run waits for them.

PLAIN = 10.0  # s between lines where a line can't be written again: in files and notebooks


class Waiting:
    """A context that says how many kernels are done, and which are being compiled."""

    def __init__(self, count, asked=False):
        self.count, self.asked, self.done, self.now = count, asked, 0, []
        self.quiet = bool(os.environ.get("TSDYN_QUIET")) or sys.stderr is None
        self.terminal = not self.quiet and sys.stderr.isatty()
        self.began = self.said = time.perf_counter()

    def __enter__(self):
        cache.tell("")
        if not self.terminal:
            self._print(f"tsdyn: compiling kernels, once for this version and machine: {self.count} ...")
        return self

    def __exit__(self, kind, *_):
        seconds = time.perf_counter() - self.began
        if kind is None:
            self._print(f"tsdyn: {self.done} of {self.count} kernels compiled in {seconds:.0f} s.", last=True)
        else:
            self._print(f"tsdyn: {self.done} of {self.count} kernels compiled.", last=True)

    def begin(self, name):
        """A kernel is begun."""
        self.now.append(name)
        self.show()

    def end(self, name, well=True):
        """It is done, or has failed."""
        self.done += well
        self.now.remove(name)
        if well and self.asked and not self.terminal:
            self._print(f"tsdyn: {self.done:3d} of {self.count}  {_short(name)}")
        self.show()

    def show(self):
        """Write the line again."""
        now = time.perf_counter()
        if self.terminal:
            names = ", ".join(map(_short, self.now))
            text = f"tsdyn: compiling kernels, once for this version and machine: {self.done} of {self.count}"
            self._print(f"{text}, {now - self.began:.0f} s ({names})")
        elif not self.asked and now - self.said > PLAIN:
            self.said = now
            self._print(f"tsdyn: {self.done} of {self.count} kernels compiled ...")

    def _print(self, text, last=False):
        if self.quiet:
            return
        if self.terminal:
            width = shutil.get_terminal_size().columns - 1
            print(f"\r{text[:width]:{width}}", end="\n" if last else "", file=sys.stderr, flush=True)
        else:
            print(text, file=sys.stderr, flush=True)


def _short(name):
    """A kernel as it is told to users: the last of its module's names, and its own."""
    module, _, own = name.partition(" ")
    home = module.rpartition(".")[2]
    return own if "." in own else f"{home}.{own}"


# Ctrl-C while a kernel compiles, while files are written, and within a long call of compiled code.
#
# LLVM calls back into Python. An exception raised in such a callback is printed and lost, and Numba then finds no
# machine code. Signals that arrive in a callback are therefore deferred to the end of the compilation.
#
# Python runs signal handlers between two of its own instructions, in the main thread alone. A long call of compiled
# code is therefore made in another thread, for which the main thread waits; a garbage collection of many objects is put
# off.

LOOK = 0.05  # s between two looks of a waiting thread, which Windows doesn't wake for Ctrl-C


@contextlib.contextmanager
def prompt_interrupts(callbacks):
    """Turn a Ctrl-C during the block into KeyboardInterrupt: at once, or at the end where LLVM calls back.

    callbacks: how the names of the functions begin that LLVM calls.
    """
    if not raises_here():
        yield
        return
    interrupted = False

    def handle(number, frame):
        nonlocal interrupted
        interrupted = True
        if not _within(frame, callbacks):
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, handle)
    try:
        yield
    except Exception:
        if not interrupted:
            raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if interrupted:
        raise KeyboardInterrupt


@contextlib.contextmanager
def deferred_interrupts():
    """Put a Ctrl-C during the block off to its end."""
    if not raises_here():
        yield
        return
    interrupted = []
    signal.signal(signal.SIGINT, lambda number, frame: interrupted.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if interrupted:
        raise KeyboardInterrupt


def interruptible(call, stop=None):
    """Return call(), which releases the GIL, and run Python's signal handlers meanwhile, in the main thread.

    What a handler raises is raised here: after `stop()`, which lets the call end soon, and its end; without `stop` at
    once, the call being one that changes nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        return call()
    future = Future()
    try:
        threading.Thread(target=_work, args=(future, call), daemon=True).start()
        while not future.done():
            wait([future], LOOK)
    except BaseException:
        if not future.cancel() and stop is not None:
            stop()
            _end(future)
        raise
    return future.result()


def _work(future, call):
    if future.set_running_or_notify_cancel():
        try:
            future.set_result(call())
        except BaseException as error:
            future.set_exception(error)


def _end(future):
    """Wait for a call, even if Ctrl-C is pressed again, or another handler raises."""
    while not future.done():
        with contextlib.suppress(BaseException):
            wait([future], LOOK)


class CollectionsDeferred(contextlib.ContextDecorator):
    """Put garbage collections during a block, or a call, off to its end; one of a million objects takes seconds."""

    def __enter__(self):
        self.enabled = gc.isenabled()
        gc.disable()

    def __exit__(self, *error):
        if self.enabled:
            gc.enable()

    def _recreate_cm(self):
        return CollectionsDeferred()


def raises_here():
    """Whether a Ctrl-C raises KeyboardInterrupt in this thread."""
    in_main = threading.current_thread() is threading.main_thread()
    return in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def _within(frame, callbacks):
    while frame is not None:
        if frame.f_code.co_name.startswith(callbacks):
            return True
        frame = frame.f_back
    return False
