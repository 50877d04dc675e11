"""The line on stderr that counts kernels; kernels as Python and Numba see them."""

import sys

import numpy as np

import tsdyn as ts
from tsdyn.jit import interrupts


class Terminal:
    def __init__(self):
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text

    def flush(self):
        pass


def test_one_line_counts_on_a_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.delenv("TSDYN_QUIET", raising=False)
    with interrupts.Waiting(2) as line:
        for name in (
            "tsdyn.configuration.initial_conditions land_start",
            "tsdyn.constraints.distance Distance.phi_loop",
        ):
            line.begin(name)
            line.end(name)
    lines = sys.stderr.text.split("\r")[1:]
    assert {len(line.rstrip("\n")) for line in lines} == {119}
    assert lines[0].split(":")[-1].strip() == "0 of 2, 0 s (initial_conditions.land_start)"
    assert lines[-1].strip() == "tsdyn: 2 of 2 kernels compiled in 0 s."
    assert sys.stderr.text.count("\n") == 1


def test_quiet(monkeypatch, capsys):
    monkeypatch.setenv("TSDYN_QUIET", "1")
    with interrupts.Waiting(1) as line:
        line.begin("tsdyn.configuration.initial_conditions land_start")
        line.end("tsdyn.configuration.initial_conditions land_start")
    assert capsys.readouterr() == ("", "")


def test_kernels_can_be_tried_from_python_and_pickled():
    import pickle

    from tsdyn.maths.dense_linalg import largest

    assert largest(np.array([1.0, -3.0])) == 3.0
    assert pickle.loads(pickle.dumps(largest)) is largest


def test_users_kernels_may_be_recursive_and_serve_numba():
    import numba

    @ts.kernel
    def factorial(n):
        if n <= 1:
            return 1
        return n * factorial(n - 1)

    @numba.njit
    def used(x):
        return factorial(4) + x

    assert (factorial(3), used(2)) == (6, 26)
