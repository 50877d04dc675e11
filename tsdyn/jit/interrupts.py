"""Ctrl-C while a kernel compiles, or while files are written.

LLVM calls back into Python. An exception raised in such a callback is printed and lost, and Numba then finds no machine
code. Signals that arrive in a callback are therefore deferred to the end of the compilation.
"""

import contextlib
import signal
import threading


@contextlib.contextmanager
def prompt_interrupts():
    """Turn a Ctrl-C during the block into KeyboardInterrupt: at once, or at the end where LLVM calls back."""
    if not _raises_here():
        yield
        return
    interrupted = False

    def handle(number, frame):
        nonlocal interrupted
        interrupted = True
        if not _in_callback(frame):
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
    if not _raises_here():
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


def _raises_here():
    """Whether a Ctrl-C raises KeyboardInterrupt in this thread."""
    in_main = threading.current_thread() is threading.main_thread()
    return in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def _in_callback(frame):
    while frame is not None:
        if frame.f_code.co_name.startswith("_raw_object_cache"):
            return True
        frame = frame.f_back
    return False
