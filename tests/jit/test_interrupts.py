"""Ctrl-C during a long call of compiled code, here one that waits until it is let go."""

import os
import signal
import threading

import pytest

from tsdyn.jit.interrupts import interruptible

pytestmark = pytest.mark.skipif(os.name == "nt", reason="a process can't press its own Ctrl-C")
PATIENCE = 60.0  # s, after which a call that nothing ends fails


@pytest.fixture
def call():
    """A call that begins with a Ctrl-C and ends when `free` is set."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def call():
        os.kill(os.getpid(), signal.SIGINT)
        call.ended = call.free.wait(PATIENCE)

    call.free, call.ended = threading.Event(), False
    yield call
    call.free.set()
    signal.signal(signal.SIGINT, before)


def test_a_call_is_stopped_and_awaited(call):
    with pytest.raises(KeyboardInterrupt):
        interruptible(call, call.free.set)
    assert call.ended


def test_a_call_that_changes_nothing_is_left(call):
    with pytest.raises(KeyboardInterrupt):
        interruptible(call)
    assert not call.ended


def test_another_thread_calls_by_itself():
    found = []
    thread = threading.Thread(target=lambda: found.append(interruptible(threading.get_ident)))
    thread.start()
    thread.join()
    assert found == [thread.ident]


def test_results_and_errors():
    assert interruptible(lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0)
