"""TOML of plain data, to the last bit; lines and columns of values in a TOML text."""

import json
import math
import re
from contextlib import suppress
from functools import cached_property

# Lines and columns in a TOML text: where each value stands.

_SPACE = re.compile(r"[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRINGS = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' + r"'''.*?'{3,5}|" + r'"(?:\\.|[^"\\\n])*"|' + r"'[^'\n]*'", re.DOTALL
)
_OTHER = re.compile(r"[^\s,\]}#]+(?: [0-9][^\s,\]}#]*)?")


class Places:
    """Where each value of a valid TOML text stands, by path, a tuple of keys and indices.

    Parameters
    ----------
    text : str
        That tomllib has read.
    """

    def __init__(self, text):
        self.text, self._offsets, self._counts = text, {}, {}

    @cached_property
    def offsets(self):
        """Offsets by path, found when they are first asked for."""
        with suppress(IndexError, AttributeError, RecursionError):  # for messages: what is found so far serves
            self._scan()
        return self._offsets

    def line_and_column(self, path):
        """Line and column, from 1, of a value, or of the innermost table around it that is known."""
        if path not in self.offsets and (*path[:-1], "at", *path[-1:]) in self.offsets:
            path = (*path[:-1], "at", *path[-1:])
        while path and path not in self.offsets:
            path = path[:-1]
        offset = self.offsets.get(path, 0)
        line = self.text.count("\n", 0, offset) + 1
        return line, offset - (self.text.rfind("\n", 0, offset) + 1) + 1

    def _scan(self):
        at, table = 0, ()
        while True:
            at = _BLANK.match(self.text, at).end()
            if at >= len(self.text):
                return
            if self.text[at] == "[":
                at, table = self._header(at)
            else:
                at = self._pair(at, table)

    def _header(self, at):
        """A header; the offset after it, and the path of its table."""
        begin, several = at, self.text.startswith("[[", at)
        keys, at = self._keys(at + 1 + several)
        path = ()
        for key in keys[:-1]:
            path = self._latest((*path, key))
        path = (*path, keys[-1])
        if several:
            self._offsets.setdefault(path, begin)
            count = self._counts[path] = self._counts.get(path, -1) + 1
            path = (*path, count)
        self._offsets.setdefault(path, begin)
        return at + 1 + several, path

    def _latest(self, path):
        """The path of a table, or of the latest of an array of tables."""
        return (*path, self._counts[path]) if path in self._counts else path

    def _keys(self, at):
        """A dotted key, and the offset after it and the blanks behind."""
        keys = []
        while True:
            at = _SPACE.match(self.text, at).end()
            quoted = self.text[at] in "\"'"
            found = (_STRINGS if quoted else _BARE).match(self.text, at)
            keys.append(found.group()[1:-1] if quoted else found.group())
            at = _SPACE.match(self.text, found.end()).end()
            if self.text[at] != ".":
                return keys, at
            at += 1

    def _pair(self, at, table):
        """A key and its value; the offset after it."""
        keys, at = self._keys(at)
        at = _SPACE.match(self.text, at + 1).end()
        return self._value(at, (*table, *keys))

    def _value(self, at, path):
        """A value; the offset after it."""
        self._offsets.setdefault(path, at)
        first = self.text[at]
        if first == "[":
            return self._items(at + 1, "]", path)
        if first == "{":
            return self._items(at + 1, "}", path)
        return (_STRINGS if first in "\"'" else _OTHER).match(self.text, at).end()

    def _items(self, at, end, path):
        """What is in brackets; the offset after them."""
        count = 0
        while True:
            at = _BLANK.match(self.text, at).end()
            if self.text[at] == end:
                return at + 1
            at = self._value(at, (*path, count)) if end == "]" else self._pair(at, path)
            count += 1
            at = _BLANK.match(self.text, at).end()
            if self.text[at] == ",":
                at += 1


# TOML of plain data: tables, lists, text, numbers to the last bit.

WIDTH = 110


def write(document):
    """The TOML text of a document: values first, then tables, then arrays of tables."""
    lines = _pairs(document)
    for key, value in document.items():
        if isinstance(value, dict):
            lines += ["", f"[{_key(key)}]", *_pairs(value, nested=False)]
    for key, value in document.items():
        if _is_tables(value):
            for table in value:
                lines += ["", f"[[{_key(key)}]]", *_pairs(table, nested=False)]
    return "\n".join(lines).lstrip("\n") + "\n"


def _is_tables(value):
    return isinstance(value, list) and bool(value) and all(isinstance(part, dict) for part in value)


def _pairs(table, nested=True):
    """The lines of the pairs of a table; nested: without its tables, which have headers."""
    return [
        f"{_key(key)} = {_value(value)}"
        for key, value in table.items()
        if not (nested and (isinstance(value, dict) or _is_tables(value)))
    ]


def _key(key):
    return key if _BARE.fullmatch(key) else _text(key)


def _text(value):
    """A basic string; TOML has the escapes of JSON, and no surrogates."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float):
        return _float(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items()) + " }"
    return _list([_value(part) for part in value])


def _float(value):
    if not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return repr(value)


def _list(parts):
    """A list, over several lines if it is long."""
    line = "[" + ", ".join(parts) + "]"
    if len(line) <= WIDTH:
        return line
    lines, row = [], ""
    for part in parts:
        if row and len(row) + len(part) + 2 > WIDTH:
            lines.append(row)
            row = ""
        row += f"{part}, "
    return "[\n" + "\n".join(f"  {row.rstrip()}" for row in (*lines, row)) + "\n]"
