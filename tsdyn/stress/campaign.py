"""The gallery, random scenes and calls, judged by worker processes that are replaced when they crash; the report.

A `Job` is a scene, or a block of calls, of one seed; it comes out the same in every process. `work` yields the outcomes
as they come; closing the generator, as Ctrl-C does, ends the processes.
"""

import math
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections import Counter
from contextlib import closing, contextmanager
from itertools import pairwise
from multiprocessing.connection import wait
from typing import NamedTuple

import numpy as np

from ..drawing import BLUE, GREEN, GREY, VERMILION, ZERO, aligned, new_figure
from ..errors import TsdynError
from ..integrators import DOP853, Nystrom4, Taylor
from ..maths.tolerances import EPS
from ..simulation.prepared_run import simulate
from ..simulation.solution import Solution
from .closed_forms import CLOSED_FORMS, Measured, measured
from .gallery import CASES, Case
from .judgement import FAULT, Judgement, judge_scene
from .laws import energy_left, findings, resumed_is_same, same_bits
from .random_calls import judge_calls

TOLERANCE = 1e-15, 1e-12  # of Taylor, and of the other method
OUTPUTS = 129  # output times of a run
PARTS = 5  # doublings of time, over which the growth of the energy error is fitted
SEEN = 2.0 * EPS  # energy errors below this are rounding: their growth is not fitted


class CheckedRun(NamedTuple):
    """A run of a case by the Taylor integrator, at the limit of rounding."""

    case: Case
    solution: Solution


def run_case(case):
    """Return the `CheckedRun` of a case."""
    t = np.linspace(0.0, case.end, OUTPUTS)
    options = {"integrator": Taylor(TOLERANCE[0]), "t_eval": t, "dense_output": True}
    return CheckedRun(case, simulate(case.build(), (0.0, case.end), **options))


def size(run):
    """Bodies, constraint rows, steps, and the time of the run, s."""
    scene, stats = run.solution.scene, run.solution.stats
    rows = len(run.solution.system.segments)
    return {"bodies": len(scene.bodies), "rows": rows, "steps": stats.steps, "seconds": stats.seconds["run"]}


def ending(run):
    """Whether the run reached its end, and what it said."""
    return {"success": run.solution.success, "message": run.solution.message}


def constraint_errors(run):
    """Largest constraint errors of position, velocity and acceleration."""
    return {name: float(error.max()) for name, error in run.solution.constraint_error._asdict().items()}


def energy(run):
    """Largest error of energy less work, relative to the energies, and the exponent of its growth with time."""
    left, whole = energy_left(run.solution)
    error = np.abs(run.solution.energy - run.solution.work - run.solution.energy[0]) / (whole or 1.0)
    ends = [(OUTPUTS - 1) >> part for part in range(PARTS)]
    sizes = np.array([np.sqrt(np.mean(error[end // 2 : end + 1] ** 2)) for end in ends])
    seen = sizes > SEEN
    exponent = np.polyfit(np.log(ends)[seen], np.log(sizes[seen]), 1)[0] if seen.sum() > 2 else np.nan
    worst = np.maximum.accumulate(np.abs(error))
    growth = [(i / (OUTPUTS - 1), float(worst[i])) for i in range(1, OUTPUTS)]
    return {"energy": left / (whole or 1.0), "exponent": float(exponent), "growth": growth}


def order(run):
    """Return the observed order of Nystrom4, of three runs with steps halved; declared: 4."""
    end, count = run.case.steps
    scene, ends = run.case.build(), []
    for halving in range(3):
        method = Nystrom4(step=end / (count << halving))
        solution = simulate(scene, (0.0, end), integrator=method, t_eval=(0.0, end))
        if not solution.success:
            return {"order": np.nan}
        ends.append(solution.q[-1])
    coarse, fine = (np.abs(a - b).max() for a, b in pairwise(ends))
    return {"order": float(np.log2(coarse / fine)) if fine > 0.0 else np.nan}


def agreement(run):
    """Largest distance in q from a run by DOP853, relative to the largest coordinate."""
    until = run.case.agree or run.case.end
    t = run.solution.t[run.solution.t <= until]
    other = simulate(run.case.build(), (0.0, t[-1]), integrator=DOP853(*2 * TOLERANCE[1:]), t_eval=t)
    if not other.success:
        return {"agreement": np.nan}
    q = run.solution.q[: t.size]
    return {"agreement": float(np.abs(other.q - q).max() / np.abs(q).max())}


def laws(run):
    """The laws that the run breaks."""
    return {"broken": [str(found) for found in findings(run.solution) if found.broken]}


def repeated(first):
    """Whether a second run gives the same bits."""
    return {"same": same_bits(first.solution, run_case(first.case).solution)}


def resumed(run):
    """Whether a run that was stopped, and goes on from its checkpoint, gives the same bits; None without h5py."""
    case, options = run.case, {"integrator": Taylor(TOLERANCE[0]), "t_eval": run.solution.t}
    return {"resumed": resumed_is_same(case.build(), (0.0, case.end), run.solution, **options)}


CHECKS = (size, ending, constraint_errors, energy, order, agreement, laws, repeated, resumed)


def figures(case):
    """All figures of a case, by name."""
    began, found = time.perf_counter(), {"case": case.name, "hard": case.hard}
    try:
        made = run_case(case)
        for check in CHECKS:
            found |= check(made)
    except TsdynError as error:
        found |= without_figures(case, f"{type(error).__name__}: {error}")
    return found | {"wall": time.perf_counter() - began}


def without_figures(case, message):
    """Figures of a case that could not be run."""
    unknown = {"broken": [], "same": True, "resumed": None}
    return {"case": case.name, "hard": case.hard, "success": False, "message": message, **unknown}


# The figure of `tsdyn stress`: constraint errors and energy errors of the cases of the gallery, over time.

COLOURS = 10  # of matplotlib's cycle
LEVELS = (("position", BLUE, "o"), ("velocity", GREEN, "s"), ("acceleration", VERMILION, "^"))


def figure(found):
    """Return a matplotlib Figure: constraint errors of each case, and its energy error over time.

    Raises
    ------
    MissingDependency
        If matplotlib is not installed.
    """
    with new_figure(11.0, 0.34 * len(found) + 2.2) as drawn:
        errors, energies = drawn.subplots(1, 2)
        names = [figures["case"] for figures in found]
        rows = np.arange(len(found))[::-1]
        for level, colour, marker in LEVELS:
            values = [max(figures[level], ZERO) for figures in found]
            errors.plot(values, rows, marker, color=colour, label=level, markersize=5)
        errors.set(xscale="log", yticks=rows, xlabel="largest constraint error (m, m/s, m/s²)")
        errors.set_yticklabels(names)
        errors.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize="small")
        errors.grid(axis="y", color=GREY, alpha=0.2)
        for i, figures in enumerate(found):
            share, error = np.array(figures["growth"]).T
            style = "-" if i < COLOURS else "--"
            energies.plot(share, np.maximum(error, ZERO), style, linewidth=1.0, label=figures["case"])
        energies.set(xscale="log", yscale="log", xlabel="share of the run", ylabel="relative error of energy")
        energies.legend(fontsize=6, frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        for axes in (errors, energies):
            axes.spines[["top", "right"]].set_visible(False)
    return drawn


MARKS = "<!-- tsdyn stress: begin -->", "<!-- tsdyn stress: end -->"  # of a page, around what is replaced
LONGEST = 400  # characters of what a fault said
NONE = "-"  # of a figure that a case doesn't have


class FigureColumn(NamedTuple):
    """A column of the table: its head, the figure, and how that is written."""

    head: str
    figure: str
    spec: str


COLUMNS = (
    FigureColumn("case", "case", ""),
    FigureColumn("bodies", "bodies", "d"),
    FigureColumn("rows", "rows", "d"),
    FigureColumn("steps", "steps", "d"),
    FigureColumn("time (s)", "seconds", ".2f"),
    FigureColumn("Phi", "position", ".1e"),
    FigureColumn("velocity", "velocity", ".1e"),
    FigureColumn("acceleration", "acceleration", ".1e"),
    FigureColumn("energy", "energy", ".1e"),
    FigureColumn("exponent", "exponent", ".2f"),
    FigureColumn("order", "order", ".2f"),
    FigureColumn("methods", "agreement", ".1e"),
    FigureColumn("same bits", "same", "yes"),
    FigureColumn("resumed", "resumed", "yes"),
    FigureColumn("laws", "broken", "kept"),
)
LEGEND = (
    "Taylor at tolerance 1e-15. Phi, velocity, acceleration: largest constraint errors (m, m/s, m/s^2).",
    "energy: error of energy less work, relative to the energies; exponent: of its growth with time, above rounding.",
    "resumed: whether a run that was stopped and goes on from its checkpoint gives the same bits.",
    "order: observed, of Nystrom4 (declared: 4). methods: largest relative distance of q from DOP853 at 1e-12.",
)


def cell(figures, column):
    """Return an entry of the table."""
    value = figures.get(column.figure)
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return NONE
    if column.spec == "yes":
        return "yes" if value else "NO"
    if column.spec == "kept":
        return "kept" if not value else f"{len(value)} BROKEN"
    return format(value, column.spec)


def cells(found, columns=COLUMNS):
    """Return the heads and all entries, as lists of strings."""
    return [[column.head for column in columns], *([cell(figures, column) for column in columns] for figures in found)]


def wrong(figures):
    """Return what is wrong with a case, one line each; nothing if all went well."""
    said = [] if figures["success"] else [figures["message"]]
    said += figures["broken"]
    if not figures["same"]:
        said.append("a second run gave other bits")
    if figures["resumed"] is False:
        said.append("a run that went on from a checkpoint gave other bits")
    return [f"{figures['case']}: {text}" for text in said]


def gallery_text(found):
    """Return the table of the gallery, and what went wrong."""
    return "\n".join([*aligned(cells(found)), "", *LEGEND, *(text for figures in found for text in wrong(figures))])


def closed_forms_text(found):
    """Return the table of the closed forms, and why one could not be measured."""
    rows = [("closed form", "error", "allowed", "")]
    rows += [
        (each.name, f"{each.error:.1e}", f"{each.allowed:.1e}", "holds" if each.holds else "OFF") for each in found
    ]
    return "\n".join([*aligned(rows), *(f"{each.name}: {each.message}" for each in found if each.message)])


def fault_text(job, outcome):
    """Return a fault, with the command that repeats it."""
    return f"{outcome.word}: {outcome.name}: {outcome.said[:LONGEST]}\n  repeat it: {job.command}"


def tally_text(tally, seed):
    """Return the counts of the random scenes and calls."""
    lines = []
    for kind in ("scenes", "calls"):
        counts = tally.counts[kind]
        if counts:
            lines.append(f"{tally.total(kind)} random {kind}:")
            lines += [f"{count:9d}  {word}" for word, count in counts.most_common()]
    if tally.slowest:
        lines.append(f"The longest scene took {tally.slowest.seconds:.1f} s (seed {tally.slowest.seed}).")
    end = "interrupted" if tally.interrupted else "done"
    return "\n".join([*lines, f"{len(tally.faults)} faults; {end} after {tally.seconds:.0f} s, seed {seed}."])


def as_data(found, closed, tally, seed):
    """Return everything as data."""
    data = {"seed": seed, "gallery": found}
    data["closed_forms"] = [{**each._asdict(), "holds": each.holds} for each in closed]
    if tally is not None:
        faults = [{**outcome._asdict(), "command": job.command} for job, outcome in tally.faults]
        data["fuzz"] = {
            **{kind: dict(counts) for kind, counts in tally.counts.items()},
            "faults": faults, "seconds": tally.seconds, "interrupted": tally.interrupted,
        }  # fmt: skip
    return data


def as_markdown(found, tally):
    """Return the table and what makes each case hard, as Markdown."""
    head, *rows = cells(found)
    lines = ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    lines += ["", *LEGEND, ""]
    if tally is not None:
        done = " and ".join(f"{tally.total(kind)} random {kind}" for kind in tally.counts)
        lines += [f"With it: {done}, {len(tally.faults)} faults.", ""]
    lines += ["| case | what makes it hard |", "|---|---|"]
    shown = {figures["case"] for figures in found}
    lines += [f"| {case.name} | {case.hard} |" for case in CASES if case.name in shown]
    return "\n".join(lines)


LIMIT = 300.0  # s of processor time, of a job: also of those that compile kernels
GALLERY_LIMIT = 1200.0  # s of processor time, of a case
BEAT = 0.5  # s between two looks of a process at its processor time
BLOCK = 40  # calls of a job
BLAS_THREADS = "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"


class Job(NamedTuple):
    """What a worker does."""

    kind: str  # "scenes" or "calls"; "gallery" and "closed forms", whose seed is the index of a case
    seed: int
    count: int = 1

    @property
    def command(self):
        """The command that does this job alone."""
        other = "calls" if self.kind == "scenes" else "scenes"
        return f"tsdyn stress --fuzz --{self.kind} {self.count} --{other} 0 --seed {self.seed}"


class Tally:
    """Outcomes so far: counts of scenes and calls, the faults, and the longest scene."""

    def __init__(self):
        self.counts = {"scenes": Counter(), "calls": Counter()}
        self.faults, self.slowest, self.seconds, self.interrupted = [], None, 0.0, False

    def add(self, job, outcomes):
        """Count the outcomes of a job; return its faults."""
        new = [(job, outcome) for outcome in outcomes if outcome.fault]
        self.faults += new
        for outcome in outcomes:
            self.counts[job.kind][outcome.word] += 1
            if job.kind == "scenes" and (self.slowest is None or outcome.seconds > self.slowest.seconds):
                self.slowest = outcome
        return new

    def total(self, kind):
        """Return the number of scenes or calls."""
        return sum(self.counts[kind].values())


def jobs(scenes, calls, seed):
    """Yield so many scenes and calls, scene and block of calls i of seed + i."""
    for i in range(max(scenes, -(-calls // BLOCK))):
        if i < scenes:
            yield Job("scenes", seed + i)
        if i * BLOCK < calls:
            yield Job("calls", seed + i, min(BLOCK, calls - i * BLOCK))


def run(plan, processes=1, report=None, limit=LIMIT):
    """Do all jobs and return the `Tally`, that so far after Ctrl-C; report(tally, new faults) is called after each."""
    tally, began = Tally(), time.perf_counter()
    try:
        with closing(work(plan, processes, limit)) as done:
            for job, outcomes in done:
                new = tally.add(job, outcomes)
                tally.seconds = time.perf_counter() - began
                if report:
                    report(tally, new)
    except KeyboardInterrupt:
        tally.interrupted = True
    tally.seconds = time.perf_counter() - began
    return tally


def run_gallery(indices, processes=1, report=None):
    """Return the figures of some of CASES in their order, those so far after Ctrl-C, and whether all were made."""
    return _run_all("gallery", indices, processes, lambda i, said: without_figures(CASES[i], said), report)


def run_closed_forms(indices, processes=1, report=None):
    """Return the `Measured` of some of CLOSED_FORMS in their order, likewise."""
    return _run_all("closed forms", indices, processes, lambda i, said: _unmeasured(CLOSED_FORMS[i], said), report)


def _unmeasured(form, said):
    return Measured(form.name, math.nan, form.allowed, said)


def _run_all(kind, indices, processes, without, report):
    """What the jobs of a kind give, in their order; without(index, said) where a process gave nothing."""
    found, complete = {}, True
    try:
        with closing(work([Job(kind, i) for i in indices], processes, GALLERY_LIMIT)) as done:
            for job, [result] in done:
                failed = isinstance(result, Judgement)
                found[job.seed] = without(job.seed, f"{result.word} {result.said}") if failed else result
                if report:
                    report(found[job.seed])
    except KeyboardInterrupt:
        complete = False
    return [found[i] for i in sorted(found)], complete


def work(plan, processes, limit=LIMIT):
    """Yield (job, outcomes) in the order in which they come."""
    plan, idle, busy = iter(plan), [], {}
    try:
        while True:
            while len(busy) < processes and (job := next(plan, None)) is not None:
                worker = idle.pop() if idle else Worker()
                worker.begin(job, limit)
                busy[worker.connection] = worker
            if not busy:
                return
            patience = max(min(worker.until for worker in busy.values()) - time.monotonic(), 0.0)
            for connection in wait(list(busy), patience):
                worker = busy.pop(connection)
                yield worker.job, worker.outcomes()
                if worker.alive:
                    idle.append(worker)
            for connection in [c for c, worker in busy.items() if worker.is_overdue()]:
                worker = busy.pop(connection)
                worker.end()
                yield worker.job, [worker.fault("silent", f"for {limit:g} s")]
    finally:
        for worker in (*idle, *busy.values()):
            worker.end()


class Worker:
    """A process that does jobs one by one."""

    def __init__(self):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.spent = context.Value("d", 0.0, lock=False)  # s of processor time
        self.process = context.Process(target=serve, args=(other, self.spent), daemon=True)
        with ignoring_interrupts(), _one_blas_thread():
            self.process.start()
        other.close()
        self.alive, self.job, self.until, self.looked, self.left = True, None, 0.0, 0.0, 0.0

    def begin(self, job, limit):
        """Send a job."""
        self.job, self.until, self.looked, self.left = job, time.monotonic() + limit, self.spent.value, limit
        self.connection.send(job)

    def is_overdue(self):
        """Whether the job has used its processor time up, or none since the last look: a busy machine is no fault."""
        if time.monotonic() < self.until:
            return False
        used, self.looked = self.spent.value - self.looked, self.spent.value
        self.left -= used
        self.until = time.monotonic() + max(self.left, 20.0 * BEAT)
        return used <= 0.0 or self.left <= 0.0

    def outcomes(self):
        """Receive the outcomes of the job; of a process that has ended, that."""
        try:
            return self.connection.recv()
        except (EOFError, OSError):
            self.process.join()
            code = self.process.exitcode
            self.end()
            return [self.fault("crash", f"exit code {code}")]

    def fault(self, word, said):
        """Return the outcome of a job that gave none."""
        return Judgement(self.job.seed, self.job.kind, f"{FAULT} {word}", said)

    def end(self):
        """End the process."""
        self.alive = False
        self.process.kill()
        self.process.join()
        self.connection.close()


@contextmanager
def ignoring_interrupts():
    """Ignore Ctrl-C, and so do processes that begin meanwhile: it is for the process that sends the jobs."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _one_blas_thread():
    """Let processes that begin meanwhile use one thread each for dense matrices: more would wait for each other."""
    before = {name: os.environ.get(name) for name in BLAS_THREADS}
    os.environ.update(dict.fromkeys(BLAS_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def serve(connection, spent):
    """Do the jobs that come in, and report the processor time."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_beat, args=(spent,), daemon=True).start()
    warnings.simplefilter("ignore")
    while True:
        try:
            job = connection.recv()
        except EOFError:
            return
        connection.send(WAYS[job.kind](job))


def _beat(spent):
    while True:
        spent.value = time.process_time()
        time.sleep(BEAT)


WAYS = {
    "scenes": lambda job: [judge_scene(job.seed)],
    "calls": lambda job: judge_calls(job.seed, job.count),
    "gallery": lambda job: [figures(CASES[job.seed])],
    "closed forms": lambda job: [measured(CLOSED_FORMS[job.seed])],
}
