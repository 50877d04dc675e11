"""The line on stderr that counts kernels while a first run waits for them."""

import os
import shutil
import sys
import time

from . import cache

PLAIN = 10.0  # s between lines where a line can't be written again: in files and notebooks


class Waiting:
    """A context that says how many kernels are done, and which are being compiled."""

    def __init__(self, count, asked=False):
        self.count, self.asked, self.done, self.now = count, asked, 0, []
        self.quiet = bool(os.environ.get("TSDYN_QUIET")) or sys.stderr is None
        self.terminal = not self.quiet and sys.stderr.isatty()
        self.began = self.said = time.perf_counter()

    def __enter__(self):
        cache.tell("")
        if not self.terminal:
            self._print(f"tsdyn: compiling kernels, once for this version and machine: {self.count} ...")
        return self

    def __exit__(self, kind, *_):
        seconds = time.perf_counter() - self.began
        if kind is None:
            self._print(f"tsdyn: {self.done} of {self.count} kernels compiled in {seconds:.0f} s.", last=True)
        else:
            self._print(f"tsdyn: {self.done} of {self.count} kernels compiled.", last=True)

    def begin(self, name):
        """A kernel is begun."""
        self.now.append(name)
        self.show()

    def end(self, name, well=True):
        """It is done, or has failed."""
        self.done += well
        self.now.remove(name)
        if well and self.asked and not self.terminal:
            self._print(f"tsdyn: {self.done:3d} of {self.count}  {_short(name)}")
        self.show()

    def show(self):
        """Write the line anew."""
        now = time.perf_counter()
        if self.terminal:
            names = ", ".join(map(_short, self.now))
            text = f"tsdyn: compiling kernels, once for this version and machine: {self.done} of {self.count}"
            self._print(f"{text}, {now - self.began:.0f} s ({names})")
        elif not self.asked and now - self.said > PLAIN:
            self.said = now
            self._print(f"tsdyn: {self.done} of {self.count} kernels compiled ...")

    def _print(self, text, last=False):
        if self.quiet:
            return
        if self.terminal:
            width = shutil.get_terminal_size().columns - 1
            print(f"\r{text[:width]:{width}}", end="\n" if last else "", file=sys.stderr, flush=True)
        else:
            print(text, file=sys.stderr, flush=True)


def _short(name):
    """A kernel as it is told to users: the last of its module's names, and its own."""
    module, _, own = name.partition(" ")
    home = module.rpartition(".")[2]
    return own if "." in own else f"{home}.{own}"
