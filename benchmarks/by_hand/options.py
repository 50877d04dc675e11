"""How the kernels written by hand are compiled; those in a file of their own can be cached, as Numba stamps only that."""

ALONE = {"error_model": "numpy", "fastmath": {"contract"}, "cache": True}
PART = {"error_model": "numpy", "fastmath": {"contract"}}
