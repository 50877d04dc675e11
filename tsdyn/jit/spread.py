"""Numbers of an array as arguments of a call: function(t, *spread(numbers, COUNT)) in a kernel."""

from numba.np.unsafe.ndarray import to_fixed_tuple

from .kernels import DEBUG


def _tuple(numbers, count):
    """The first `count` numbers, a constant."""
    return tuple(numbers[:count])


spread = _tuple if DEBUG else to_fixed_tuple
