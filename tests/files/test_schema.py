"""The published JSON Schema is that of the classes, and a run imports nothing of scene files."""

import json
import subprocess
import sys

import tsdyn as ts
from tests.helpers.built_in import FORCES, JOINTS, PRIMITIVES
from tools.schema import TARGET
from tsdyn.files.schema import text


def test_the_schema_is_up_to_date():
    assert TARGET.read_text(encoding="utf-8") == text(ts.Scene, ts.simulate), "write it anew: python -m tools.schema"


def test_every_class_of_data_is_in_it():
    found = json.loads(TARGET.read_text())["properties"]
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
