"""Pinocchio where it can't be built: its times by ratios to a kernel written by hand, measured together elsewhere.

results/pinocchio.json holds the ratios, by scene and error; the kernel is timed here, and its time scaled.
"""

import json
from pathlib import Path

import numpy as np

from ..by_hand.contenders import CONTENDERS
from ..contender import Contender
from .pinocchio import Pinocchio

RATIOS = Path(__file__).parents[1] / "results" / "pinocchio.json"
KERNEL = CONTENDERS[0]
ERRORS = tuple(10.0**-k for k in range(3, 13))


class Scaled(Contender):
    """Runs the kernel; serves only where Pinocchio itself is missing."""

    name = "Pinocchio, scaled"
    values = KERNEL.values
    get = f"{RATIOS.name} is written by a run where Pinocchio can be built"

    def version(self):
        """When and where the ratios were measured."""
        data = json.loads(RATIOS.read_text())
        return f"ratios of {data['date']}: {data['contenders'][Pinocchio.name]}, {data['machine']}"

    def serves(self, scene):
        """The scenes of the file, where Pinocchio can't be built."""
        return (
            not self.missing()
            and bool(Pinocchio().missing())
            and scene.name in json.loads(RATIOS.read_text())["ratios"]
        )

    def prepare(self, scene):
        """Prepare the kernel; a time is scaled by the ratio at the error reached, between those recorded."""
        table = json.loads(RATIOS.read_text())["ratios"][scene.name]
        errors, ratios = np.log([float(e) for e in table]), np.log(list(table.values()))
        order = np.argsort(errors)
        reference, kernel = scene.reference(), KERNEL.prepare(scene)

        def run(tol):
            outcome = kernel(tol)
            off = np.log(max(outcome.error(reference.r[-1], reference.A[-1]), 1e-16))
            return outcome._replace(
                seconds=outcome.seconds * float(np.exp(np.interp(off, errors[order], ratios[order])))
            )

        return run


def ratios(results):
    """Ratios of Pinocchio's time to the kernel's, {scene: {error: ratio}}, of a run of `work_precision`."""
    found = {}
    for one in results:
        names = (Pinocchio.name, KERNEL.name)  # least times: ratios that a busy machine leaves alone
        pairs = {error: [one.seconds_to(name, error, "least") for name in names] for error in ERRORS}
        table = {f"{error:.0e}": a / b for error, (a, b) in pairs.items() if np.isfinite(a) and np.isfinite(b)}
        if table:
            found[one.scene] = table
    return found
