"""`python -m tsdyn`: the command `tsdyn`."""

from .cli import main

if __name__ == "__main__":
    raise SystemExit(main())
