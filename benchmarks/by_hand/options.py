"""How the kernels written by hand are compiled; a file that needs no other can be cached."""

ALONE = {"error_model": "numpy", "fastmath": {"contract"}, "cache": True}
PART = {"error_model": "numpy", "fastmath": {"contract"}}
