"""Platform wheels that carry tsdyn's own kernels, compiled.

    TSDYN_SHIP_KERNELS=1 pip wheel --no-deps .

Without TSDYN_SHIP_KERNELS the wheel is pure Python, as pyproject.toml says. Wheels with kernels are for one version of
Python, whose byte code names the kernels and whose C interface their wrappers use.
"""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py


class PlatformDistribution(Distribution):
    """A package that isn't pure Python, though it has no extension modules."""

    def has_ext_modules(self):
        """Yes."""
        return True


class BuildWithKernels(build_py):
    """Compile the kernels of the package that has been built, beside it."""

    def run(self):
        """As of setuptools, then the kernels."""
        super().run()
        if not self.editable_mode:
            folder = Path(self.build_lib).absolute()
            command = [
                sys.executable,
                "-c",
                "import sys; from tsdyn.ahead import ship; ship(sys.argv[1])",
                str(folder / "tsdyn" / "kernels"),
            ]
            subprocess.run(command, cwd=folder, check=True)


class PlatformWheel(bdist_wheel):
    """A wheel for this Python on this system; the kernels need nothing of a C library but its mathematics."""

    def get_tag(self):
        """The oldest manylinux that has a name."""
        python, abi, system = super().get_tag()
        return python, abi, system.replace("linux_", "manylinux_2_17_", 1) if system.startswith("linux_") else system


if os.environ.get("TSDYN_SHIP_KERNELS", "") in ("", "0"):
    setup()
else:
    project = tomllib.loads(Path(__file__).with_name("pyproject.toml").read_text(encoding="utf-8"))["project"]
    setup(
        distclass=PlatformDistribution,
        cmdclass={"build_py": BuildWithKernels, "bdist_wheel": PlatformWheel},
        setup_requires=project["dependencies"],  # which compile the kernels
    )
