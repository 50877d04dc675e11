"""What Numba says of a function that it can't compile, in one line; the whole text is the cause of the error."""

import re

STAGE = re.compile(r"Failed in .* pipeline|During: |$")  # a line that says where in Numba, or nothing


def complaint(error):
    """The first line that says what is wrong, with the call that has no implementation."""
    lines = [line.strip() for line in str(error).splitlines()]
    said = next((line for line in lines if not STAGE.match(line)), type(error).__name__)
    call = next((line.removeprefix(">>> ") for line in lines if line.startswith(">>> ")), "")
    said = f"no implementation of {call}" if said.startswith("No implementation of function") and call else said
    return f"Numba says: {said.rstrip('.')}."
