"""Cases in chunks: shared out to threads, or sent to an executor of processes or of machines."""

import contextlib
import hashlib
import pickle
import threading
import time
import warnings
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, ThreadPoolExecutor, wait

import numpy as np

from ..ahead import processors
from ..calls import line_of_user
from ..errors import InvalidArgument, MissingDependency, Status
from ..runs.tolerances import SLICE_SECONDS
from .cases import TIMES
from .runner import PLAIN, Chunk, Runner, Study
from .tolerances import AHEAD, CHUNK_SECONDS, GROWTH, MOST_CASES, MOST_KEPT, RETRIES, SENT_SECONDS

# Chunks of cases: what threads and processes are given, and what they give back.

NOT_RUN = int(Status.NOT_RUN)
ALWAYS = ("t", "q", "qd")  # of the same shape in every case


OTHER_SHAPE = "keep must return arrays of the same shape for every case, it gave one of shape {}, and {} before."


def run_chunk(runner, first, count, offset=0):
    """Run cases from `first` on; the `Chunk`, and whether Ctrl-C has ended it early.

    offset: the number of the first case of the study among all.
    """
    study, messages = runner.study, {}
    status, arrays = np.full(count, NOT_RUN), empty(study, count)
    interrupted, k = False, 0
    try:
        chunk = Chunk(first, status, messages, arrays, runner.values(slice(first, first + count)))
        while (k := runner.run_many(chunk, k)) < count:
            if study.stopped:
                raise KeyboardInterrupt
            record = runner.run(chunk, k)
            said = _enter(arrays, k, record.arrays)
            message = said or record.message
            if message is not PLAIN:
                messages[k] = message
            status[k] = record.status if said is None else Status.CASE_FAILED
            k += 1
    except KeyboardInterrupt:
        interrupted = True
    done = int(np.argmax(status == NOT_RUN)) if (status == NOT_RUN).any() else count
    parts = {name: array[:done] for name, array in arrays.items()}
    said = {offset + first + k: message for k, message in messages.items()}
    return Chunk(offset + first, status[:done], said, parts), interrupted


def _enter(arrays, k, found):
    """Write arrays of a case; what is wrong with them, or None."""
    for name, value in found.items():
        if name in ALWAYS:
            arrays[name][k] = value
            continue
        if name not in arrays:
            arrays[name] = np.full((len(arrays["t"]), *np.shape(value)), np.nan)
        if np.shape(value) != arrays[name].shape[1:]:
            return OTHER_SHAPE.format(np.shape(value), arrays[name].shape[1:])
        arrays[name][k] = value
    return None


def empty(study, cases):
    """Arrays by name for so many cases, all NaN."""
    shape = (study.times.size, study.n) if study.keep == TIMES else (study.n,)
    return {"t": np.full(cases, np.nan), "q": np.full((cases, *shape), np.nan), "qd": np.full((cases, *shape), np.nan)}


def fitted(chunk, shapes):
    """A chunk whose arrays have these shapes, by name: its cases have failed where they have others."""
    wrong = {
        name: array.shape[1:]
        for name, array in chunk.arrays.items()
        if array.shape[1:] != shapes.get(name, array.shape[1:])
    }
    if not wrong:
        return chunk
    status, messages = chunk.status.copy(), dict(chunk.messages)
    name = next(iter(wrong))
    for k in np.flatnonzero(np.isin(status, (int(Status.SUCCESS), int(Status.EVENT)))).tolist():
        status[k], messages[chunk.first + k] = Status.CASE_FAILED, OTHER_SHAPE.format(wrong[name], shapes[name])
    return chunk._replace(
        status=status, messages=messages, arrays={k: v for k, v in chunk.arrays.items() if k not in wrong}
    )


class Collected:
    """Results of all cases in memory.

    Parameters
    ----------
    study : Study
    """

    first, is_full, reason = 0, False, ""  # case to begin with; whether to wait; why cases are missing

    def __init__(self, study):
        count = study.cases.count
        self.status, self.messages, self.arrays = np.full(count, int(Status.NOT_RUN)), {}, empty(study, count)

    def add(self, chunk):
        """Take over the results of a chunk; cases that are known already stay as they are."""
        chunk = fitted(chunk, {name: array.shape[1:] for name, array in self.arrays.items()})
        rows = slice(chunk.first, chunk.first + chunk.count)
        fresh = self.status[rows] == Status.NOT_RUN
        self.status[rows][fresh] = chunk.status[fresh]
        self.messages |= {i: message for i, message in chunk.messages.items() if fresh[i - chunk.first]}
        for name, values in chunk.arrays.items():
            if name not in self.arrays:
                self.arrays[name] = np.full((len(self.status), *values.shape[1:]), np.nan)
            self.arrays[name][rows][fresh] = values[fresh]

    def close(self):
        """Do nothing: all is in memory."""


# Cases shared out to threads of this process.


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


def run_threads(study, sink, threads, report):
    """Run the cases of a study on threads, which give their chunks to the sink; the number of threads.

    None: this thread alone where all cases together are short, else as many as there are processors. `report(cases)` is
    informed of progress. Ctrl-C ends it: whether it did.
    """
    queue = Queue(sink.first, study.cases.count, least=study.lanes)
    runner, began = Runner(study), time.perf_counter()
    while threads is None:  # the first case makes what all have in common
        pair = queue.take()
        if pair is None:
            return 1, False
        if _run(runner, pair, queue, sink, report):
            return 1, True
        if time.perf_counter() - began > CHUNK_SECONDS:
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
            time.sleep(SLICE_SECONDS)
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
                thread.join(SLICE_SECONDS)
                report(self.finished - told)
                told = self.finished
        report(self.finished - told)


# Cases sent in chunks to an executor: processes, or workers of Dask on this machine and others.

CLOSED = "executor: it takes no work: {}. Give one that is open, such as within `with ProcessPoolExecutor() as pool:`."

_idle = {}  # of a worker: digest of what was sent -> runners that no thread uses


def run_job(sent, part, offset):
    """Run a chunk of cases in a worker; the `Chunk`, and the seconds that it has taken.

    sent: a `Study`, or (digest, bytes) of what it is made of; part: the cases, or bytes of them.
    """
    runners = sent.idle if isinstance(sent, Study) else _runners_of(sent[0])
    try:
        runner = runners.pop()
    except IndexError:
        runner = None
    cases = pickle.loads(part) if isinstance(part, bytes) else part
    if runner is None:
        runner = Runner(sent.twin(cases) if isinstance(sent, Study) else _study(sent[1], cases))
    runner.study.cases = cases
    began = time.perf_counter()
    chunk, interrupted = run_chunk(runner, 0, cases.count, offset)
    if interrupted:
        raise KeyboardInterrupt
    runners.append(runner)
    return chunk, time.perf_counter() - began


def _runners_of(digest):
    """The idle runners of a study, which are kept for the last few studies."""
    while digest not in _idle and len(_idle) >= MOST_KEPT:
        _idle.pop(next(iter(_idle)), None)
    return _idle.setdefault(digest, [])


def _study(payload, cases):
    scene, *given = pickle.loads(payload)
    return Study(scene, cases, *given)


def run_executor(study, sink, executor, report):
    """Run the cases of a study on an executor, whose chunks go to the sink; whether it ended early.

    Raises
    ------
    InvalidArgument, MissingDependency
        If it is no executor, or what is sent can't be pickled.
    """
    with _opened(executor) as (pool, workers, is_dask):
        return _Sender(study, sink, pool, workers, is_dask).run(report)


@contextlib.contextmanager
def _opened(executor):
    """The executor with the interface of concurrent.futures, how many workers it has, and whether it is Dask's."""
    if isinstance(executor, str) or type(executor).__module__.partition(".")[0] == "distributed":
        try:
            from distributed import Client
        except ImportError as error:
            raise MissingDependency("an address of a scheduler needs Dask: pip install 'tsdyn[cluster]'.") from error
        client = _connected(Client, executor) if isinstance(executor, str) else executor
        if isinstance(client, Client) and client.status not in ("running", "connecting"):
            raise InvalidArgument(CLOSED.format(f"the client of Dask is {client.status}"))
        pool = client.get_executor(pure=False, retries=RETRIES)
        try:
            yield pool, sum(client.nthreads().values()) or 1, True
        finally:
            pool.shutdown(wait=False)
            if client is not executor:
                client.close()
    elif callable(getattr(executor, "submit", None)) and not isinstance(executor, type):
        yield executor, getattr(executor, "_max_workers", None) or 4, False
    else:
        raise InvalidArgument(
            "executor must be an Executor of concurrent.futures, a dask.distributed.Client or the address of its "
            f"scheduler, got {executor!r}."
        )


def _connected(kind, address):
    """A client of the scheduler at an address; the handshake can fail while a worker joins, and is tried again."""
    try:
        for _ in range(RETRIES):
            with contextlib.suppress(AssertionError):
                return kind(address)
        return kind(address)
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"executor: there is no scheduler of Dask at {address!r} ({error}).") from error


class _Sender:
    """Sends chunks, a few ahead of the workers, and collects what comes back."""

    def __init__(self, study, sink, pool, workers, is_dask):
        self.study, self.sink, self.pool, self.most = study, sink, pool, AHEAD * workers
        self.queue, self.pending, self.again = Queue(sink.first, study.cases.count, SENT_SECONDS, study.lanes), {}, []
        self.tries, self.dump = {}, None
        if isinstance(pool, ThreadPoolExecutor):
            self.sent = study
        else:
            self.dump = _pickler(is_dask)
            payload = self.dump((study.scene, study.options, study.call, study.keep, study.free, study.lanes))
            self.sent = hashlib.sha256(payload).hexdigest(), payload

    def run(self, report):
        """Run all; whether it ended early."""
        try:
            self._send()
            while self.pending:
                done, _ = wait(self.pending, SLICE_SECONDS, FIRST_COMPLETED)
                for future in done:
                    report(self._collect(future))
                report(0)
                self._send()
        except (BrokenExecutor, KeyboardInterrupt) as error:
            self._end(report, waits=isinstance(error, BrokenExecutor))
            if isinstance(error, BrokenExecutor):
                self.sink.reason = f"The executor broke: {type(error).__name__}: {error}"
                warnings.warn(f"{self.sink.reason} Cases that had come back are kept.", stacklevel=line_of_user())
            return True
        except BaseException:
            for future in self.pending:
                future.cancel()
            raise
        return False

    def _end(self, report, waits):
        """Cancel what hasn't begun; take over what is done, and what still runs if the end is worth waiting for."""
        running = [future for future in self.pending if not future.cancel()]
        if waits:
            with contextlib.suppress(KeyboardInterrupt):
                wait(running)
        for future in running:
            if future.done() and future.exception() is None:
                report(self._collect(future))

    def _send(self):
        while len(self.pending) < self.most and (self.again or not self.sink.is_full):
            pair = self.again.pop() if self.again else self.queue.take()
            if pair is None:
                return
            part = self.study.cases.part(slice(pair[0], sum(pair)))
            part = part if self.dump is None else self.dump(part)
            self.pending[self._submit(part, pair[0])] = pair

    def _submit(self, part, first):
        """The future of a chunk; raises InvalidArgument if the executor has been shut down before the first one."""
        try:
            return self.pool.submit(run_job, self.sent, part, first)
        except BrokenExecutor:
            raise
        except RuntimeError as error:
            if self.pending or first > self.sink.first:
                raise BrokenExecutor(str(error)) from error
            raise InvalidArgument(CLOSED.format(error)) from error

    def _collect(self, future):
        """Take over a chunk, or send it again if its worker is lost; how many cases have come back."""
        pair = self.pending.pop(future)
        try:
            chunk, seconds = future.result()
        except (BrokenExecutor, KeyboardInterrupt):
            raise
        except BaseException as error:
            self.tries[pair] = self.tries.get(pair, 0) + 1
            if not _is_lost(error) or self.tries[pair] > RETRIES:
                raise
            self.again.append(pair)
            return 0
        self.queue.timed(chunk.count, seconds)
        self.sink.add(chunk)
        return chunk.count


def _is_lost(error):
    """Whether an error says that a worker is gone, not that a case is wrong."""
    return isinstance(error, CancelledError) or type(error).__name__ in ("KilledWorker", "CommClosedError")


def _pickler(is_dask):
    """A function that pickles what is sent; functions of a script by value where cloudpickle is there."""
    try:
        from cloudpickle import dumps as by_value
    except ImportError:
        by_value = None

    def dump(value):
        try:
            return by_value(value) if is_dask and by_value else pickle.dumps(value)
        except Exception as error:
            if by_value is not None and not is_dask:
                return by_value(value)
            raise InvalidArgument(
                f"the scene, its functions and keep= are sent to other processes and can't be pickled: {error}. Define "
                "functions at module level, or use threads."
            ) from error

    return dump
