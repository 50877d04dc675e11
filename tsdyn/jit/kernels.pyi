# What of kernels.py is public; all else there is for kernels, which Numba types.
from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

def kernel(function: Function, allocates: bool = False, inline: bool = True) -> Function: ...
def __getattr__(name: str) -> Any: ...
