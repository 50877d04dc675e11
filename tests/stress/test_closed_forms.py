"""Closed forms of `tsdyn stress`: each holds, and one that does not is told."""

import json

import pytest

import tsdyn as ts
from tsdyn.cli import main
from tsdyn.stress import closed_forms
from tsdyn.stress.closed_forms import CLOSED_FORMS, ClosedForm, measured


@pytest.mark.slow_but("*anchor*", "*wire*", "*rod*", "*event*", "*turns*", "*pulse*")
@pytest.mark.parametrize("form", CLOSED_FORMS, ids=lambda form: form.name)
def test_closed_forms_hold(form):
    if "mimics" in form.name:
        pytest.importorskip("lxml")
    found = measured(form)
    assert found.holds, found


def test_what_does_not_hold_is_told():
    def refused():
        raise ts.InvalidArgument("no")

    assert not measured(ClosedForm("off", lambda: 2.0, 1.0)).holds
    found = measured(ClosedForm("refused", refused, 1.0))
    assert (found.holds, found.message) == (False, "InvalidArgument: no")


@pytest.mark.slow
def test_the_command_runs_them(capsys):
    assert main(["stress", "wire", "--json"]) == 0
    [found] = json.loads(capsys.readouterr().out)["closed_forms"]
    assert found["name"] == next(form.name for form in closed_forms.CLOSED_FORMS if "wire" in form.name)
    assert found["holds"]
