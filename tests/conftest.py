"""What every test may use: a seeded random generator, and hypothesis without clocks or a data base."""

import zlib

import hypothesis
import numpy as np
import pytest

hypothesis.settings.register_profile("tsdyn", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("tsdyn")


@pytest.fixture
def rng(request):
    """A random generator, seeded by the name of the test: the same in every run, another in every test."""
    return np.random.default_rng(zlib.crc32(request.node.name.encode()))
