"""Runs that are stopped and gone on with."""

import numpy as np

OUTPUTS = ("t", "q", "qd", "qdd", "multipliers")


class Stop:
    """Ctrl-C after so many slices."""

    def __init__(self, count):
        self.left = count

    def __call__(self, fraction):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def same(one, other):
    for name in OUTPUTS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    for a, b in zip((*one.steps, *one.charts), (*other.steps, *other.charts), strict=True):
        np.testing.assert_array_equal(a, b)
    counts = [{**vars(each.stats), "seconds": None} for each in (one, other)]
    assert counts[0] == counts[1]
    assert (one.status, one.message) == (other.status, other.message)
    np.testing.assert_array_equal(one.state.q, other.state.q)
    for a, b in zip(one.t_events or [], other.t_events or [], strict=True):
        np.testing.assert_array_equal(a, b)
