"""Cases shared out to threads of this process."""

import os
import threading
import time

from .chunks import run_chunk
from .runner import Runner
from .tolerances import ALONE_SECONDS, CHUNK_SECONDS, GROWTH, LOOK, MOST_CASES


class Queue:
    """Cases that wait, handed out in chunks that take about so many seconds, multiples of `least` cases."""

    def __init__(self, first, end, seconds=CHUNK_SECONDS, least=1):
        self.next, self.end, self.seconds, self.least, self._lock = first, end, seconds, least, threading.Lock()
        self.size = least

    def take(self):
        """(first, count) of a chunk; None at the end."""
        with self._lock:
            first, count = self.next, min(self.size, self.end - self.next)
            self.next += count
        return (first, count) if count > 0 else None

    def timed(self, count, seconds):
        """Adapt the size of the next chunks to the time that one has taken."""
        wanted = count * self.seconds / max(seconds, 1e-9)
        wanted = min(int(wanted), GROWTH * count, MOST_CASES)
        self.size = max(wanted // self.least, 1) * self.least


def processors():
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_threads(study, sink, threads, report):
    """Run the cases of a study on threads, which give their chunks to the sink; the number of threads.

    None: this thread alone where all cases together are short, else as many as there are processors. `report(cases)` is
    told of progress. Ctrl-C ends it: whether it did.
    """
    queue = Queue(sink.first, study.cases.count, least=study.lanes)
    runner, began = Runner(study), time.perf_counter()
    while threads is None:  # the first case makes what all have in common
        pair = queue.take()
        if pair is None:
            return 1, False
        if _run(runner, pair, queue, sink, report):
            return 1, True
        if time.perf_counter() - began > ALONE_SECONDS:
            threads = processors()
    if threads == 1:
        return 1, _run_here(runner, queue, sink, report)
    return threads, _Pool(study, queue, sink, threads).run(report)


def _run(runner, pair, queue, sink, report):
    """Run a chunk; whether Ctrl-C has ended it."""
    began = time.perf_counter()
    chunk, interrupted = run_chunk(runner, *pair)
    queue.timed(pair[1], time.perf_counter() - began)
    sink.add(chunk)
    report(chunk.count)
    return interrupted


def _run_here(runner, queue, sink, report):
    try:
        while (pair := queue.take()) is not None:
            if _run(runner, pair, queue, sink, report):
                return True
    except KeyboardInterrupt:  # between two cases
        return True
    return False


class _Pool:
    """Threads with a runner each; the thread that asks waits for them, so that Ctrl-C reaches it."""

    def __init__(self, study, queue, sink, count):
        self.study, self.queue, self.sink = study, queue, sink
        self.lock, self.news, self.finished, self.errors = threading.Lock(), threading.Event(), 0, []
        self.threads = [threading.Thread(target=self._work, daemon=True) for _ in range(count)]

    def _work(self):
        try:
            runner = Runner(self.study)
            while self._may_go_on() and (pair := self.queue.take()) is not None:
                began = time.perf_counter()
                chunk, _ = run_chunk(runner, *pair)
                self.queue.timed(pair[1], time.perf_counter() - began)
                with self.lock:
                    self.sink.add(chunk)
                    self.finished += chunk.count
        except BaseException as error:  # raised again by the thread that waits
            self.errors.append(error)
            self.study.stopped = True

    def _may_go_on(self):
        """Wait while results wait for others to be written."""
        while self.sink.is_full and not self.study.stopped:
            time.sleep(LOOK)
        return not self.study.stopped

    def run(self, report):
        """Run all; whether Ctrl-C has ended it."""
        interrupted = False
        for thread in self.threads:
            thread.start()
        try:
            self._wait(report)
        except KeyboardInterrupt:
            interrupted = self.study.stopped = True
            for thread in self.threads:
                thread.join()
        if self.errors:
            raise self.errors[0]
        return interrupted

    def _wait(self, report):
        told = 0
        for thread in self.threads:
            while thread.is_alive():
                thread.join(LOOK)
                report(self.finished - told)
                told = self.finished
        report(self.finished - told)
