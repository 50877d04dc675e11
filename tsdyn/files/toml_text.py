"""TOML of plain data: tables, lists, text, numbers to the last bit."""

import json
import math
import re

WIDTH = 110
_BARE = re.compile(r"[A-Za-z0-9_-]+")


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
