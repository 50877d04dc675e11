"""Tables of the pages are measured by one command, and stand between marks."""

import pytest

from docs import measure


@pytest.mark.parametrize("name", measure.TABLES)
def test_pages_have_marks(name):
    page = (measure.DOCS / measure.TABLES[name][1]).read_text(encoding="utf-8")
    written = measure.marked(page, name, "| new |")
    assert "begin -->\n| new |\n<!-- " in written
    assert measure.marked(written, name, "| new |") == written
    with pytest.raises(LookupError, match="no marks"):
        measure.marked("a page", name, "| new |")


@pytest.mark.slow
def test_the_table_of_methods(monkeypatch):
    monkeypatch.setattr(measure, "METHODS", ("taylor", "rk45"))
    monkeypatch.setattr(measure, "QUICK", ("sliding top",))
    head, rule, *rows = measure.methods(quick=True).splitlines()[:5]
    assert head == "| scene | error | `taylor` | `rk45` |"
    assert rule.count("|") == 5
    assert [row.split(" | ")[1] for row in rows] == ["1e-04", "1e-06", "1e-10"]
    assert all(row.count("**") == 2 for row in rows)
