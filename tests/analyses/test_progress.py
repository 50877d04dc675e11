"""Progress of linearisation and of the search for equilibria: fractions, bars, and what Ctrl-C says."""

import re

import pytest

import tsdyn as ts
from tests.helpers.hanging_chains import pendulums
from tests.helpers.spinning_tops import spinning_top
from tsdyn.simulation import termination

CALLS = {
    "linearise": lambda progress: pendulums([0.3, 0.2, 1.0]).linearise(progress=progress),
    "equilibrium": lambda progress: pendulums([0.3, 0.2, 1.0]).equilibrium(progress=progress),
    "equilibrium with a spin": lambda progress: spinning_top(0.6, 0.0, 0.0)[0].equilibrium(
        spin=(0, 0, 13.0), rotors={"top": 150.0}, progress=progress
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_callable_receives_growing_fractions(name):
    seen = []
    CALLS[name](seen.append)
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)
    assert len(seen) > 4


@pytest.mark.parametrize("name", CALLS)
def test_a_bar_is_shown_after_a_while_only(name, capsys, monkeypatch):
    monkeypatch.setattr(termination, "BAR_AFTER", 1e3)
    CALLS[name](True)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(termination, "BAR_AFTER", 0.0)
    CALLS[name](True)
    assert re.search(r"  0%\|.*100%\|.* done *\n$", capsys.readouterr().err, re.DOTALL)


@pytest.mark.parametrize("name", CALLS)
def test_an_interrupt_says_what_was_reached(name):
    def stop(fraction):
        if fraction >= 0.7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        CALLS[name](stop)
    said = str(caught.value)
    assert said.startswith(f"{name.split()[0]} was interrupted at {'8' if name == 'linearise' else '7'}0%: ")
    assert ("steps" in said) == (name != "linearise")


@pytest.mark.parametrize("name", CALLS)
def test_what_progress_raises_is_passed_on(name):
    def fail(fraction):
        raise RuntimeError("no terminal")

    with pytest.raises(RuntimeError, match="no terminal"):
        CALLS[name](fail)
    with pytest.raises(ts.InvalidArgument, match="progress must be True, False, None or a function"):
        CALLS[name]("bar")
