"""Points and directions given in the ground frame (`at`)."""

import numpy as np
import pytest

from tests.helpers.closed_loops import bricard


@pytest.mark.parametrize("i", range(6))
def test_zeros_of_a_body_frame_are_exact(i):
    """A rotation leaves 1e-16 of them, which biases the energy of Bricard's loop."""
    joint = list(bricard().constraints)[i]
    for place in joint.coordinates:
        size = np.abs(place)
        assert (size[size > 0.0] > 1e-3 * size.max()).all()
