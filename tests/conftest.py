"""For every test: a seeded random generator, hypothesis without clocks or a data base, kernels compiled ahead."""

import gc
import os
import zlib
from fnmatch import fnmatchcase

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: the processes of pytest-xdist share the processors

import hypothesis
import numpy as np
import pytest

from tests.helpers.shared_kernels import shared_kernels
from tsdyn.ahead import compile_ahead

hypothesis.settings.register_profile("tsdyn", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("tsdyn")


@pytest.fixture
def rng(request):
    """A random generator, seeded by the name of the test: the same in every run, another in every test."""
    return np.random.default_rng(zlib.crc32(request.node.name.encode()))


@pytest.fixture
def few_objects():
    """Leave what there is, a million objects, out of further garbage collections: one in the test takes no second."""
    gc.freeze()


def pytest_sessionstart(session):
    """Compile by all processors what most tests need, so that no worker of pytest-xdist waits for another's kernel."""
    config = session.config
    whole = config.args_source is config.ArgsSource.TESTPATHS  # not some files alone
    if whole and not config.option.collectonly and not hasattr(config, "workerinput"):
        compile_ahead(dict.fromkeys(shared_kernels()))


def pytest_collection_finish(session):
    """Leave what is imported and collected, a million objects, out of all further garbage collections."""
    gc.freeze()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark as slow what `slow_but` and `slow_for` say, before `-m` selects."""
    idle = set()
    used = set()
    for item in items:
        for mark in (*item.iter_markers("slow_but"), *item.iter_markers("slow_for")):
            found = [pattern for pattern in mark.args if fnmatchcase(item.callspec.id, pattern.removeprefix("!"))]
            chosen = bool(found) and not any(pattern.startswith("!") for pattern in found)
            if chosen == (mark.name == "slow_for"):
                item.add_marker("slow")
            idle |= {(item.originalname, pattern) for pattern in mark.args}
            used |= {(item.originalname, pattern) for pattern in found}
    if idle - used and config.args_source is config.ArgsSource.TESTPATHS:
        raise pytest.UsageError(f"slow_but or slow_for with patterns that match no test: {sorted(idle - used)}")
