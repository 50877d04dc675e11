"""Modules that docs/plug-ins.md named once: an import of one of them says where its contents are now."""

import sys

MOVED = frozenset(
    [
        "angle",
        "force",
        "framed_joint",
        "integrator",
        "joint",
        "markers",
        "motion",
        "primitive",
        "recurrences",
        "stepping",
        "tableau",
    ]
)
PACKAGE = __name__.partition(".")[0]


class Signpost:
    """A finder that finds nothing; asked last."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        """Raise ModuleNotFoundError for what has moved."""
        package, _, module = name.partition(".")
        if package == PACKAGE and module in MOVED:
            raise ModuleNotFoundError(
                f"{name} has moved: authors of constraints, forces and integrators import from {package}.plugins, "
                f"for instance `from {package}.plugins import dot, step_kernel`. All else below {package} is private.",
                name=name,
            )


def install():
    """Put it behind all other finders, once."""
    if Signpost not in sys.meta_path:
        sys.meta_path.append(Signpost)
