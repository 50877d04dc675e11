"""Pages of classes: made from file and docstring, for plug-ins as for built-in classes."""

import os
import re
from types import FunctionType

import pytest

import tsdyn as ts
from docs.class_pages import ENTRIES, KINDS, ROOT, class_page, classes, entries, methods, with_entries
from docs.docstring_pages import page_of, paragraphs
from tests.helpers.built_in import PRIMITIVES
from tsdyn.elements import primitive


@pytest.fixture
def registry():
    """What a test defines is forgotten."""
    before = dict(primitive._registry)
    yield
    primitive._registry.clear()
    primitive._registry.update(before)


def test_a_joint_has_equations_arguments_an_example_its_source_and_a_picture(tmp_path):
    text = class_page(ts.constraints.Revolute, "joints", tmp_path)
    assert "x_a - x_b = 0            (1)  three rows, Spherical" in text
    assert "**`axis_a, axis_b`** : array\\_like (3,)" in text
    assert "3.133418 rad" in text
    assert "class Revolute(Joint):" in text
    assert "Markers at the end: point\\_a, point\\_b, axis\\_a, axis\\_b." in text
    assert (tmp_path / "Revolute.png").stat().st_size > 1000


def test_a_plug_in_gets_a_page(tmp_path, registry):
    class Level(ts.Primitive):
        """Keep a point of a at z = 0.

        Examples
        --------
        >>> import tsdyn as ts
        >>> scene = ts.Scene()
        >>> bead = scene.add_point_mass(mass=1.0, velocity=(1, 0, 0))
        """

        rows = 1
        markers = (ts.Point("a"),)

        @staticmethod
        def phi(x, par, t, out):
            out[0] = x[2]

        @staticmethod
        def jacobian(x, par, t, out):
            out[0, 2] = 1.0

        @staticmethod
        def gamma(x, xd, par, t, out):
            out[0] = 0.0

    assert classes("constraints").index(Level) >= len(PRIMITIVES)  # after the built-in ones
    text = class_page(Level, "constraints", tmp_path)
    assert text.startswith("# Level\n\nKeep a point of a at z = 0.")
    assert "out[0] = x[2]" in text


def test_every_class_is_of_one_kind():
    found = [cls for kind in KINDS for cls in classes(kind)]
    assert len(found) == len({*found})
    assert {ts.constraints.Distance, ts.constraints.Screw, ts.forces.Spring, ts.integrators.Taylor} <= {*found}


def test_every_public_name_is_described_on_one_page_with_a_link_to_its_source():
    written = [(ROOT / "docs" / "api" / name).read_text() for name in os.listdir(ROOT / "docs" / "api")]
    named = [name.removesuffix(".") for text in written for line in ENTRIES.findall(text) for name in line.split()]
    assert sorted({*named}) == sorted(named)
    assert {name for name in ts.__all__ if isinstance(getattr(ts, name), type | FunctionType)} <= {*named}
    assert {"motions", "plots", "shapes", "testing", *(f"{kind}/" for kind in KINDS)} <= {*named}
    examples = {name for name in methods(ts.Scene) if "Examples" in (getattr(ts.Scene, name).__doc__ or "")}
    assert {f"Scene.{name}" for name in examples} <= {*named}
    for name in ("Solution.constraint_error", "simulate", "shapes.box"):
        (text,) = entries(name)
        path, line = re.search(r"/blob/main/([\w/.]+)#L(\d+)\)", text).groups()
        assert f"def {name.split('.')[-1]}(" in "".join((ROOT / path).read_text().splitlines()[int(line) - 1 :][:4])
    assert "`Solution.reaction`" in with_entries("<!-- api: Solution. -->")


def test_docstrings_become_markdown():
    text = page_of("Move a_b.\n\n    x = 1    (1)\n\nParameters\n----------\nx : float, m\n    Of <it>.\n")
    assert text == "Move a\\_b.\n\n```text\nx = 1    (1)\n```\n\n## Parameters\n\n**`x`** : float, m\n: Of \\<it\\>."
    assert paragraphs("- one\n- two `a_b`") == "- one\n- two `a_b`"
