"""The outputs of a run as arrays: in memory, or in a store from which they are read when they are asked for."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..errors import InvalidArgument
from ..observables.kinematics import Anchor
from ..other_names import lacking
from ..validation import shown

if TYPE_CHECKING:
    from ..hints import Floats

_COLUMNS = {"t": "time", "q": "q", "qd": "qd", "qdd": "qdd", "anchor": "remembered", "_remembers": "remembered"}


class Outputs:
    """Mixed into `Solution`: t (k,), q, qd, qdd (k, n), the turns of joint angles, what forces remember (k, slots)."""

    t: Floats
    q: Floats
    qd: Floats
    qdd: Floats
    handles: Any
    _end: Any  # a `RunEnd`, or a `RecordedEnd`

    _reached = property(lambda self: self._end.reached)
    _last = property(lambda self: self._end.last)
    _angles = property(lambda self: self._end.remembered[: self.handles.count])
    _remembered = property(lambda self: self._end.remembered[self.handles.count :])
    _step_log = property(lambda self: self._end.steps)
    _chart_log = property(lambda self: self._end.charts)
    _counts = property(lambda self: self._end.counts)

    def _take(self, rows, n):
        """Take the rows (k, 1 + 3 n + angles + slots) of a run, or its `StoredOutputs`."""
        in_memory, self._slice = isinstance(rows, np.ndarray), slice(None)
        self._stored, self._rows = None if in_memory else rows, (rows, n) if in_memory else None

    def _unpack(self, rows, n):
        """Make arrays of the rows of a run, when the first of them is asked for."""
        self.q, self.qd, self.qdd = rows[:, 1 : 1 + 3 * n].reshape(-1, 3, n).swapaxes(0, 1).copy()
        self._set_remembered(rows[:, 1 + 3 * n :].copy())
        self.t = rows[:, 0].copy()
        self._rows = None

    def _set_remembered(self, rest):
        angles = self.handles.count
        self.anchor, self._remembers = Anchor(rest[:, :angles]), rest[:, angles:]

    def __getattr__(self, name: str) -> Any:
        rows, stored = self.__dict__.get("_rows"), self.__dict__.get("_stored")
        if name in _COLUMNS and rows is not None:
            self._unpack(*rows)
        if name in _COLUMNS and name in self.__dict__:  # made now, or by another thread
            return self.__dict__[name]
        if stored is None or name not in _COLUMNS:
            raise lacking(self, name)
        found = stored.read(_COLUMNS[name], self._slice)
        if _COLUMNS[name] != "remembered":
            setattr(self, name, found)
        else:
            self._set_remembered(np.empty((self._length(), 0)) if found is None else found)
        return self.__dict__[name]

    def _length(self):
        """How many outputs there are; of a store without a look at them."""
        return self.t.size if self._stored is None else len(range(self._stored.count)[self._slice])

    def __getitem__(self, part: slice) -> Self:
        """Return a solution of some of the outputs, `solution[a:b]`; of a stored run nothing else is read.

        Events, statistics and histories remain those of the whole run.
        """
        bounds = (part.start, part.stop, part.step) if isinstance(part, slice) else ("",)
        if not all(each is None or isinstance(each, (int, np.integer)) for each in bounds) or (part.step or 1) < 1:
            raise InvalidArgument(
                f"outputs are taken by slices, such as solution[100:200] or solution[::10], got {shown(part)}."
            )
        if self._stored is None:
            return self._picked(part)
        other, found = self._bare(), range(self._stored.count)[self._slice][part]
        other._slice = slice(found.start, max(found.stop, found.start), found.step)
        return other

    def _picked(self, part):
        """A solution of some outputs of a run in memory; part is a slice or indices."""
        self._length()
        other = self._bare()
        for name in ("t", "q", "qd", "qdd", "_remembers"):
            setattr(other, name, getattr(self, name)[part])
        other.anchor = Anchor(self.anchor.angles[part])
        return other

    def _bare(self):
        """A copy without what has been read, or derived from it."""
        other = copy.copy(self)
        for name in [name for name in vars(other) if name in _COLUMNS or hasattr(type(self), name)]:
            del vars(other)[name]
        return other

    __iter__ = None  # by the old protocol __getitem__ would make one
