"""Text cells of CSV that a spreadsheet would run as formulas are quoted; numbers stay numbers."""

import csv

import numpy as np

import tsdyn as ts
from tsdyn.cli import ensemble
from tsdyn.cli.ensemble import table_of


def test_names_that_begin_as_formulas(tmp_path):
    scene = ts.Scene()
    scene.add_point_mass(1.0, velocity=(-1.0, 0.0, 0.0), name="=1+1")
    found = ts.ensemble(scene, {"=1+1.mass": [1.0, 2.0]}, (0.0, 0.1))
    path = ensemble.write(found, tmp_path / "study.csv")
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    assert not [cell for cell in head if cell.startswith(("=", "+", "-", "@"))]
    assert head[1] == "'=1+1.mass"
    assert [float(row[1]) for row in rows] == [1.0, 2.0]
    assert float(rows[0][head.index("qd =1+1.x")]) == -1.0
    (tmp_path / "cases.csv").write_text("'=1+1.mass\n3.0\n")
    np.testing.assert_array_equal(table_of(tmp_path / "cases.csv", scene)["=1+1.mass"], [3.0])
