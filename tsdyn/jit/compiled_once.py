"""Users' functions, compiled once a process: equal source and constants share one compiled function.

Compiled code is never freed, so compiled functions are kept and reused.
"""

from .code_hash import deep_hash

_made = {}


def compiled_once(kind, function, make):
    """What `make()` makes of a user's function, for use as `kind`; the same one for the same code and constants."""
    key = kind, deep_hash(function)
    found = _made.get(key)
    return _made.setdefault(key, make()) if found is None else found
