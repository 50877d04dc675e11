"""Cases sent in chunks to an executor: processes, or workers of Dask on this machine and others."""

import contextlib
import hashlib
import pickle
import time
import warnings
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, ThreadPoolExecutor, wait

from ..errors import InvalidArgument, MissingDependency
from .chunks import run_chunk
from .runner import Runner, Study
from .threads import Queue
from .tolerances import AHEAD, LOOK, RETRIES, SENT_SECONDS, STUDIES

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
    while digest not in _idle and len(_idle) >= STUDIES:
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
                done, _ = wait(self.pending, LOOK, FIRST_COMPLETED)
                for future in done:
                    report(self._collect(future))
                report(0)
                self._send()
        except (BrokenExecutor, KeyboardInterrupt) as error:
            for future in self.pending:
                future.cancel()
            if isinstance(error, BrokenExecutor):
                self.sink.reason = f"The executor broke: {type(error).__name__}: {error}"
                warnings.warn(f"{self.sink.reason} Cases that had come back are kept.", stacklevel=4)
            return True
        except BaseException:
            for future in self.pending:
                future.cancel()
            raise
        return False

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
