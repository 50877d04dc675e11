"""The command `tsdyn`, also `python -m tsdyn`.

Imports everything else. Begin with command.py.
"""

from .command import main

__all__ = ["main"]
