"""Runs that must be the same."""

import numpy as np

PARTS = ("t", "q", "qd", "qdd", "multipliers")


def same_run(one, two):
    """Two solutions of one run: everything but the times of the clock has the same bits."""
    for name in PARTS:
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)
    for name in ("method", "span", "formulation", "status", "message", "success", "reached"):
        assert getattr(one, name) == getattr(two, name), name
    for a, b in zip((*one.state, *(one.t_events or [])), (*two.state, *(two.t_events or [])), strict=True):
        np.testing.assert_array_equal(a, b)
    counts = [{**vars(each.stats), "seconds": None} for each in (one, two)]
    assert counts[0] == counts[1]
    logs = [each._step_log is not None for each in (one, two)]
    assert logs[0] == logs[1]
    for name in ("steps", "charts") if logs[0] else ():
        for a, b in zip(getattr(one, name), getattr(two, name), strict=True):
            np.testing.assert_array_equal(a, b)
    dense = [each._trajectory is not None for each in (one, two)]
    assert dense[0] == dense[1]
    if dense[0]:
        t = np.linspace(*one.span, 7)
        for a, b in zip(one.at(t), two.at(t), strict=True):
            np.testing.assert_array_equal(a, b)
