"""The JSON Schema of scene files."""

import json

from tests.helpers.built_in import FORCES, JOINTS, PRIMITIVES
from tsdyn.cli import main


def test_every_class_of_data_is_in_it(capsys):
    assert main(["info", "--schema"]) == 0
    found = json.loads(capsys.readouterr().out)["properties"]
    kinds = [found[key]["items"]["oneOf"][:-1] for key in ("constraint", "force")]  # the last one is that of plug-ins
    names = {kind["properties"]["type"]["const"] for several in kinds for kind in several}
    known = {kind.__name__ for kind in (*PRIMITIVES, *JOINTS, *FORCES)}
    assert known - names == {"EulerNormalization", "JointTorque", "JointForce", "UserForce", "Control"}
