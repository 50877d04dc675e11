"""Progress of linearisation and of the search for equilibria: fractions, bars, and what Ctrl-C says."""

import sys
import time
from types import ModuleType

import pytest

import tsdyn as ts
from tests.helpers.hanging_chains import pendulums
from tests.helpers.spinning_tops import spinning_top
from tsdyn.simulation import termination as stage_progress

CALLS = {
    "linearise": lambda progress: pendulums([0.3, 0.2, 1.0]).linearise(progress=progress),
    "equilibrium": lambda progress: pendulums([0.3, 0.2, 1.0]).equilibrium(progress=progress),
    "equilibrium with a spin": lambda progress: spinning_top(0.6, 0.0, 0.0)[0].equilibrium(
        spin=(0, 0, 13.0), rotors={"top": 150.0}, progress=progress
    ),
}


@pytest.fixture
def bars(monkeypatch):
    """The bars that are made, each a list of what it has shown."""
    made = []

    class Bar:
        n = 0.0

        def __init__(self, **options):
            self.shown = []
            made.append(self.shown)

        def set_postfix_str(self, said, refresh):
            self.shown.append(said)

        def update(self, more):
            self.n += more

        def refresh(self):
            pass

        def close(self):
            self.shown.append("closed")

    module = ModuleType("tqdm.auto")
    module.tqdm = Bar
    monkeypatch.setitem(sys.modules, "tqdm.auto", module)
    return made


@pytest.mark.parametrize("name", CALLS)
def test_a_callable_receives_growing_fractions(name):
    seen = []
    CALLS[name](seen.append)
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)
    assert len(seen) > 4


@pytest.mark.parametrize("name", CALLS)
def test_a_bar_is_shown_after_a_while_only(name, bars, monkeypatch):
    CALLS[name](True)
    assert not bars
    monkeypatch.setattr(stage_progress, "BAR_AFTER", 0.0)
    usual = stage_progress.StageProgress.__call__

    def slow(self, fraction, said):
        time.sleep(0.05)
        usual(self, fraction, said)

    monkeypatch.setattr(stage_progress.StageProgress, "__call__", slow)
    CALLS[name](True)
    assert len(bars) == 1
    assert bars[0][-2:] == ["done", "closed"]


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
