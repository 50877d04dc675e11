"""tsdyn ensemble --parameters: which component a column of the table is, and what is refused, with line and column."""

import csv
import json

import numpy as np
import pytest

import tsdyn as ts
from tests.helpers.commands import called
from tsdyn.cli.ensemble import table_of, write

SCENE = """\
version = 1
[[body]]
name = "arm"
mass = 1.0
inertia = [2, 3, 4]
velocity = [5, 6, 7]
[[body]]
name = "link[3]"
type = "PointMass"
mass = 1.0
[run]
end = 0.1
"""
SKEW = SCENE.replace("[2, 3, 4]", "[[2, 0.5, 0], [0.5, 3, 0], [0, 0, 4]]")


@pytest.fixture
def ensemble(tmp_path, monkeypatch, capsys):
    """A function that gives what the command says with a table, a scene and options."""
    monkeypatch.chdir(tmp_path)

    def run(table, scene, *options):
        (tmp_path / "scene.toml").write_text(scene)
        (tmp_path / "cases.csv").write_text(table)
        return called(capsys, "ensemble", "scene.toml", "--parameters", "cases.csv", *options)

    return run


@pytest.fixture
def found(ensemble):
    """A function of a table, and of a scene, that gives the parameters of the ensemble."""

    def parameters(table, scene=SCENE):
        code, _, err = ensemble(table, scene, "--output", "a.h5")
        assert code == 0, err
        return ts.load("a.h5").parameters

    return parameters


@pytest.fixture
def refusal(ensemble):
    """A function of a table, and of a scene, that gives the message of the refusal."""

    def message(table, scene=SCENE):
        code, out, _ = ensemble(table, scene, "--json")
        told = json.loads(out)
        assert (code, told["error"]) == (1, "InvalidArgument")
        return told["message"]

    return message


def test_components_are_where_their_index_says(found):
    table = found("arm.mass,arm.inertia[2],arm.inertia[1], arm.inertia[0]\n1,4,3,2\n2,6,5,4\n")
    np.testing.assert_array_equal(table["arm.inertia"], [[2, 3, 4], [4, 5, 6]])
    np.testing.assert_array_equal(table["arm.mass"], [1, 2])


def test_components_without_a_column_are_those_of_the_scene(found):
    table = found("arm.velocity[2],gravity[1],arm.inertia[2],arm.velocity[1]\n1,2,3,8\n\n-1,-2,4.5,9\n")
    np.testing.assert_array_equal(table["arm.velocity"], [[5, 8, 1], [5, 9, -1]])
    np.testing.assert_array_equal(table["gravity"][:, 1], [2, -2])
    np.testing.assert_array_equal(table["arm.inertia"], [[2, 3, 3], [2, 3, 4.5]])


def test_one_component_moves_the_body(found):
    found("arm.velocity[2]\n1\n3\n", SCENE.replace("version = 1\n", "version = 1\ngravity = [0, 0, 0]\n"))
    np.testing.assert_allclose(ts.load("a.h5").q[:, :3], [[0.5, 0.6, 0.1], [0.5, 0.6, 0.3]], rtol=1e-13)


def test_three_cases_of_equal_principal_values(found):
    table = found("arm.inertia[0],arm.inertia[1],arm.inertia[2]\n" + 3 * "2,2,2\n", SKEW)
    np.testing.assert_array_equal(table["arm.inertia"], [2 * np.eye(3)] * 3)


def test_names_with_brackets(found):
    table = found("link[3].mass,link[3].velocity[1]\n2,1\n")
    np.testing.assert_array_equal(table["link[3].mass"], [2])
    np.testing.assert_array_equal(table["link[3].velocity"], [[0, 1, 0]])


WRONG = {
    "arm.velocity[3]\n1\n": "line 1, column 1: arm.velocity has 3 components, and no arm.velocity[3]; write "
    "arm.velocity[0] to arm.velocity[2], a column each.",
    "arm.mass,arm.velocity[-1]\n1,1\n": "column 2: arm.velocity has 3 components, and no arm.velocity[-1]",
    "arm.inertia[x]\n1\n": "column 1: arm.inertia has 3 components, and no arm.inertia[x]",
    "\narm.velocity\n1\n2\n3\n": "line 2, column 1: arm.velocity has 3 components; write arm.velocity[0]",
    "arm.mass[0]\n1\n": "arm.mass has no components in the scene; write arm.mass, not arm.mass[0].",
    "arm.mass,arm.velocity[1], arm.velocity[1]\n1,1,1\n": "column 3: arm.velocity[1] is column 2 already; remove one.",
    "arm.mas\n1\n": "column 1: the scene has no parameter 'arm.mas'; did you mean arm.mass",
    "arm.mass,\n1,1\n": "line 1, column 2 has no name",
    "arm.mass,arm.velocity[0]\n1,1\n2\n": "line 3 has 1 cell for 2 columns: arm.velocity[0] (column 2) has none",
    "arm.mass\n1,5\n": "line 2 has 2 cells for 1 column; remove what follows arm.mass (column 1)",
    "arm.mass,gravity[0]\n\n1,1\n1, \n": "line 4, column 2 (gravity[0]): the cell is empty; write one such as 0.5.",
    "arm.mass\n1\nheavy\n": "line 3, column 1 (arm.mass): 'heavy' is no finite number; write one such as 0.5.",
    "arm.mass\nnan\n": "line 2, column 1 (arm.mass): 'nan' is no finite number",
    "arm.mass\n": "cases.csv must have a row of names, and below it a row of numbers for each case.",
}


@pytest.mark.parametrize("table", WRONG)
def test_what_is_refused(table, refusal):
    told = refusal(table)
    assert told.startswith("cases.csv")
    assert WRONG[table] in told


def test_one_principal_value_of_a_matrix_with_products_is_refused(refusal):
    told = refusal("arm.inertia[2]\n1\n", SKEW)
    assert "arm.inertia is no diagonal matrix in the scene; write arm.inertia[0] to arm.inertia[2]" in told


def test_names_that_begin_as_formulas(tmp_path):
    """Text that a spreadsheet would run as a formula is quoted; numbers stay numbers."""
    scene = ts.Scene()
    scene.add_point_mass(1.0, velocity=(-1.0, 0.0, 0.0), name="=1+1")
    found = ts.ensemble(scene, {"=1+1.mass": [1.0, 2.0]}, (0.0, 0.1))
    path = write(found, tmp_path / "study.csv")
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    assert not [cell for cell in head if cell.startswith(("=", "+", "-", "@"))]
    assert head[1] == "'=1+1.mass"
    assert [float(row[1]) for row in rows] == [1.0, 2.0]
    assert float(rows[0][head.index("qd =1+1.x")]) == -1.0
    (tmp_path / "cases.csv").write_text("'=1+1.mass\n3.0\n")
    np.testing.assert_array_equal(table_of(tmp_path / "cases.csv", scene)["=1+1.mass"], [3.0])
