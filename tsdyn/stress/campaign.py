"""Random scenes and calls, judged by worker processes that are replaced when they crash or are silent for too long.

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
from multiprocessing.connection import wait
from typing import NamedTuple

from .closed_forms import CLOSED_FORMS, Measured, measured
from .gallery import CASES
from .judgement import FAULT, Judgement, judge_scene
from .random_calls import judge_calls
from .report import figures, without_figures

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
    """Do the jobs that come in, and tell the processor time."""
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
