"""Records of a workspace: numbers with names, which kernels and Python share."""

import copy
from typing import NamedTuple

import numba
import numpy as np
import pytest

from tsdyn.jit.code_hash import deep_hash, types_hash

from tsdyn.jit.kernels import (  # isort: skip
    Record, callback, caller, entry, kernel, loader, record_at, records, resident, row_of,
)  # fmt: skip


class Counts(Record):
    """Of steps."""

    size: float
    steps: int


class Inner(NamedTuple):
    """Behind another array."""

    values: np.ndarray
    counts: Counts


class Outer(NamedTuple):
    """What a kernel is given."""

    values: np.ndarray
    inner: Inner


def outer():
    """An example, all zero."""
    return Outer(np.zeros(3), Inner(np.zeros(2), Counts()))


load = loader(outer())


@kernel
def _add(counts, k):
    counts.steps += k
    counts.size = 2.0 * counts.size + k


@entry
def count(address, k):
    """Count k steps."""
    x = load(address)
    _add(x.inner.counts, k)
    if x.inner.counts.steps > 3:
        x.inner.counts.steps -= 1
    x.inner.values[0] += x.inner.counts.size
    return x.inner.counts.steps


def test_kernels_and_python_share_a_record():
    x = outer()
    address, _keep = resident(x)
    assert [count(address, 2) for _ in range(3)] == [2, 3, 4]
    assert x.inner.counts.as_dict() == {"size": 14.0, "steps": 4}
    assert x.inner.values.tolist() == [22.0, 0.0]
    x.inner.counts.steps = 10
    assert count(address, 1) == 10


def test_a_record_is_cleared_and_copied():
    counts = Counts(1.5, 7)
    other = copy.copy(counts)
    counts.clear()
    assert counts.as_dict() == {"size": 0.0, "steps": 0}
    assert other.as_dict() == {"size": 1.5, "steps": 7}


def test_a_whole_number_stays_whole():
    with pytest.raises((TypeError, ValueError)):
        Counts().steps = "many"


def test_the_layout_is_part_of_the_hash():
    class Wider(Record):
        size: float
        charts: int
        steps: int

    def hash_with(kind):
        example = Outer(np.zeros(3), Inner(np.zeros(2), kind()))
        read = loader(example)

        def steps(address):
            return read(address).inner.counts.steps

        return deep_hash(steps), types_hash([numba.typeof(example)])

    if not isinstance(load, type(lambda: 0)):  # there is a layout only where kernels are compiled
        assert hash_with(Counts) == hash_with(Counts)
        assert all(one != other for one, other in zip(hash_with(Counts), hash_with(Wider), strict=True))


def test_an_array_of_records():
    table = records(Counts, [(0.5, 3), row_of(Counts, steps=4)])
    assert table[0].steps == 3
    assert table["size"].tolist() == [0.5, 0.0]

    @kernel
    def total(rows):
        result = 0
        for i in range(rows.shape[0]):
            result += rows[i].steps
        return result

    assert total(table) == 7


class Short(Record):
    """Of a row."""

    length: float
    steps: int


class Longer(Record):
    """It begins as a `Short`."""

    length: float
    steps: int
    more: int


short_at, call_grow = record_at(Short), caller("pi")


@callback("pi")
def grow(row, k):
    """Called by address, it is given a record by its address."""
    row = short_at(row)
    row.steps += k
    row.length += 0.5 * k
    return row.steps


@entry
def grow_all(address, rows, k):
    """The sum of what `grow` returns."""
    total = 0
    for i in range(rows.size):
        total += call_grow(address, rows[i], k)
    return total


def test_a_record_is_passed_by_its_address_and_may_be_longer_than_it_is_read():
    rows = records(Longer, [(1.0, 2, 7), (3.0, 4, 8)])
    assert grow_all(grow.address, rows, 3) == 5 + 7
    assert [list(row) for row in rows] == [[2.5, 5, 7], [4.5, 7, 8]]
