"""What commands give to machines: JSON, in which what is no finite number is null; text in cells of CSV."""

import json
import math

import numpy as np

FORMULA = tuple("=+-@\t\r")  # what a spreadsheet takes a cell for that begins so


def print_json(data):
    """Print data as JSON."""
    print(json.dumps(plain(data), indent=1, allow_nan=False))


def plain(value):
    """Data for JSON: numbers of NumPy as Python's, NaN and infinities as None."""
    if isinstance(value, dict):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (int, str, type(None))) else str(value)


def text_cell(text):
    """Text for a cell of CSV: with a quote before what a spreadsheet would run as a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text
