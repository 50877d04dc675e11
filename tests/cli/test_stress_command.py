"""The command `tsdyn stress`."""

import json

import pytest

from tsdyn.cli import main
from tsdyn.stress import campaign
from tsdyn.stress.judgement import Judgement


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["tpo"], "no case of the gallery contains 'tpo'; there are: four-bars, one loop;"),
        (["--fuzz", "top"], "--fuzz runs no case"),
        (["--fuzz", "--plot", "x.png"], "show the gallery"),
        (["--scenes", "-1"], "--scenes must be a whole number from 0 on, got -1"),
        (["--processes", "0"], "--processes must be a whole number from 1 on"),
        (["--plot", "/no/such/folder/x.png"], "there is no folder"),
    ],
    ids=lambda x: " ".join(x) if isinstance(x, list) else "",
)
def test_wrong_options(arguments, words, capsys):
    assert main(["stress", *arguments]) == 1
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert words in err


@pytest.mark.slow
def test_a_case_as_text_figure_and_markdown(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    paths = {name: tmp_path / name for name in ("figure.png", "table.md")}
    arguments = ["--plot", str(paths["figure.png"]), "--markdown", str(paths["table.md"])]
    assert main(["stress", "sleeping", "--processes", "1", *arguments]) == 0
    head, row, *_ = capsys.readouterr().out.splitlines()
    assert len(head) == len(row)
    assert row.split()[-2:] == ["yes", "kept"]
    assert paths["figure.png"].exists()
    assert "| sleeping top | upright" in paths["table.md"].read_text()


@pytest.mark.slow
def test_random_scenes_and_calls_as_json(capsys):
    arguments = ["--fuzz", "--scenes", "2", "--calls", "3", "--seed", "18", "--processes", "2", "--json"]
    assert main(["stress", *arguments]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["gallery"] == []
    assert sum(data["fuzz"]["scenes"].values()) == 2
    assert sum(data["fuzz"]["calls"].values()) >= 3
    assert data["fuzz"]["faults"] == []


def test_faults_are_counted_and_their_command_given(monkeypatch, capsys):
    job = campaign.Job("scenes", 7)
    outcomes = [Judgement(7, "tree, 3 bodies", "FAULT energy less work", "1e-3"), Judgement(8, "net", "success")]
    monkeypatch.setattr(campaign, "work", lambda plan, processes, limit=0: (each for each in [(job, outcomes)]))
    assert main(["stress", "--fuzz", "--processes", "1"]) == 1
    out = capsys.readouterr().out
    assert "tsdyn stress --fuzz --scenes 1 --calls 0 --seed 7" in out
    assert "1 faults" in out


def test_ctrl_c_gives_what_there_is(monkeypatch, capsys):
    def work(plan, processes, limit=0):
        yield campaign.Job("scenes", 0), [Judgement(0, "net", "success")]
        raise KeyboardInterrupt

    monkeypatch.setattr(campaign, "work", work)
    assert main(["stress", "--fuzz"]) == 1
    out = capsys.readouterr().out
    assert "1 random scenes" in out
    assert "interrupted" in out


@pytest.mark.slow
def test_a_process_that_dies_or_is_silent_is_a_fault(monkeypatch):
    plan = [campaign.Job("no such kind", 3), campaign.Job("scenes", 18)]
    [crash] = [outcomes for job, outcomes in campaign.work(plan[:1], 1)]
    assert crash[0].word == "FAULT crash"
    [silent] = [outcomes for job, outcomes in campaign.work(plan[1:], 1, limit=0.01)]
    assert silent[0].word == "FAULT silent"


def test_jobs_are_seeds_in_turn():
    jobs = list(campaign.jobs(scenes=3, calls=50, seed=10))
    assert [(job.kind, job.seed, job.count) for job in jobs] == [
        ("scenes", 10, 1), ("calls", 10, 40), ("scenes", 11, 1), ("calls", 11, 10), ("scenes", 12, 1),
    ]  # fmt: skip
    assert campaign.tally_text(campaign.Tally(), 0).startswith("0 faults; done")
