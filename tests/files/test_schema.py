"""The JSON Schema has every class that a file can name, and a run imports nothing of scene files."""

import json
import subprocess
import sys

from tests.helpers.built_in import FORCES, JOINTS, PRIMITIVES
from tsdyn.cli import main


def test_every_class_of_data_is_in_it(capsys):
    assert main(["info", "--schema"]) == 0
    found = json.loads(capsys.readouterr().out)["properties"]
    kinds = [found[key]["items"]["oneOf"][:-1] for key in ("constraint", "force")]  # the last one is that of plug-ins
    names = {kind["properties"]["type"]["const"] for several in kinds for kind in several}
    known = {kind.__name__ for kind in (*PRIMITIVES, *JOINTS, *FORCES)}
    assert known - names == {"EulerNormalization", "JointTorque", "JointForce", "UserForce", "Control"}


def test_a_plain_run_imports_nothing_of_it():
    code = (
        "import sys, tsdyn as ts; s = ts.Scene(); s.add_point_mass(1.0); ts.simulate(s, (0, 1)).q; "
        "names = 'tsdyn.files', 'tsdyn.cli', 'tomllib', 'pandas', 'xarray', 'h5py'; "
        "print([name for name in sys.modules if name.startswith(names)])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found.strip() == "[]"
