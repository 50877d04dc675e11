"""Singularity indicator: the smallest pivot of S relative to its diagonal entry.

The indicator falls as the square of the distance to a singular configuration. It is compared with its largest value
in the run.
"""

from ..jit.kernels import kernel
from .independent_rows import weakest
from .tangent_workspace import LARGEST_SHARE, SHARE

NEAR = 0.02  # of the largest share: a place with less is near a singular configuration
NEXT_TO, WITHIN_A_STEP = 1e-3, 0.2  # of it: less is next to one; where fixed steps can't be made, less than


@kernel
def note_share(network, f, values):
    """Take the factors of S at a chart or a step's end, `values`, for where the scene is now."""
    sizes = f.sizes
    sizes[SHARE] = weakest(network, values)
    sizes[LARGEST_SHARE] = max(sizes[SHARE], sizes[LARGEST_SHARE])


@kernel
def is_below(f, part):
    """Whether the share is less than a part of the largest."""
    return f.sizes[SHARE] < part * f.sizes[LARGEST_SHARE]
