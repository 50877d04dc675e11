"""Runs that are stopped and gone on with."""


class Stop:
    """Ctrl-C after so many slices."""

    def __init__(self, count):
        self.left = count

    def __call__(self, fraction):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
