"""Ensembles on executors: processes and clusters give the bits of threads, and lose no case."""

import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import tsdyn as ts
from examples import top

SPAN, TABLE = (0.0, 0.02), {"top.mass": np.linspace(20.0, 40.0, 40)}


def height(solution):
    """Of the top at the end, slowly."""
    time.sleep(0.01)
    return solution.state.q[2]


def kill_once(solution):
    """Kill the worker once, in the middle of the study."""
    path = os.environ["TSDYN_TEST_KILLED"]
    if solution.scene.bodies[0].mass > 30.0 and not os.path.exists(path):
        with open(path, "w") as file:
            file.write(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    return solution.state.q[2]


def expected():
    return ts.ensemble(top.build(), TABLE, SPAN)


def test_threads_of_an_executor():
    with ThreadPoolExecutor(2) as pool:
        found = ts.ensemble(top.build(), TABLE, SPAN, executor=pool, keep=lambda s: s.state.q[2])
    assert np.array_equal(found.q, expected().q)
    assert np.array_equal(found.kept, found.q[:, 2])


@pytest.mark.slow
def test_processes():
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        found = ts.ensemble(top.build(), TABLE, SPAN, executor=pool, keep=height)
        again = ts.ensemble(top.build(), TABLE, SPAN, executor=pool)
    assert np.array_equal(found.kept, expected().q[:, 2])
    assert np.array_equal(again.q, found.q)
    assert found.threads == 0


@pytest.mark.slow
def test_a_pool_that_breaks_keeps_what_has_come_back(tmp_path, monkeypatch):
    monkeypatch.setenv("TSDYN_TEST_KILLED", str(tmp_path / "killed"))
    path = tmp_path / "study.h5"
    with ProcessPoolExecutor(2, get_context("spawn")) as pool, pytest.warns(UserWarning, match="The executor broke"):
        found = ts.ensemble(top.build(), TABLE, SPAN, executor=pool, keep=kill_once, store=path)
    done = int(found.success.sum())
    assert found.interrupted
    assert done < 40
    assert "The executor broke" in found.message[-1]
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        found = ts.ensemble(top.build(), TABLE, SPAN, executor=pool, keep=kill_once, store=path, resume=True)
    assert np.array_equal(found.kept, expected().q[:, 2])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_whose_worker_is_killed_loses_nothing(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("TSDYN_TEST_KILLED", str(tmp_path / "killed"))
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        fractions = []
        found = ts.ensemble(top.build(), TABLE, SPAN, executor=client, keep=kill_once, progress=fractions.append)
        assert (tmp_path / "killed").exists()
        assert found.success.all(), found.message
        assert fractions[-1] == 1.0
        by_address = ts.ensemble(top.build(), TABLE, SPAN, executor=cluster.scheduler_address)
    assert np.array_equal(found.kept, expected().q[:, 2])
    assert np.array_equal(by_address.q, expected().q)


def test_an_address_without_a_scheduler():
    pytest.importorskip("distributed")
    from dask.config import set as settings

    refused = pytest.raises(ts.InvalidArgument, match=r"no scheduler of Dask at 'tcp://127\.0\.0\.1:9'")
    with settings({"distributed.comm.timeouts.connect": "0.1s"}), refused:
        ts.ensemble(top.build(), TABLE, SPAN, executor="tcp://127.0.0.1:9")


def test_a_handshake_that_fails_is_tried_again(monkeypatch):
    distributed, tries = pytest.importorskip("distributed"), []

    def connect(address):
        tries.append(address)
        assert len(tries) > 1
        raise OSError("no route")

    monkeypatch.setattr(distributed, "Client", connect)
    with pytest.raises(ts.InvalidArgument, match="no route"):
        ts.ensemble(top.build(), TABLE, SPAN, executor="tcp://127.0.0.1:9")
    assert len(tries) == 2


def test_what_is_no_executor():
    with pytest.raises(ts.InvalidArgument, match=r"an Executor of concurrent\.futures"):
        ts.ensemble(top.build(), TABLE, SPAN, executor=3)


@pytest.mark.parametrize("kind", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_an_executor_that_has_been_shut_down(kind, tmp_path):
    with kind(1) as pool:
        pass
    for store in (None, tmp_path / "study.h5"):
        with pytest.raises(
            ts.InvalidArgument, match=r"executor: it takes no work: .*after shutdown\. Give one that is open"
        ):
            ts.ensemble(top.build(), TABLE, SPAN, executor=pool, store=store)
    assert not [*tmp_path.iterdir()]
    with pytest.raises(ts.InvalidArgument, match=r"must be an Executor of concurrent\.futures"):
        ts.ensemble(top.build(), TABLE, SPAN, executor=kind)


class _Closing(ThreadPoolExecutor):
    """Takes one chunk; by the time of the second one it has been shut down."""

    def __init__(self):
        super().__init__(1)
        self.refused = threading.Event()

    def submit(self, *given):
        try:
            return super().submit(*given)
        except RuntimeError:
            self.refused.set()
            raise
        finally:
            self.shutdown(wait=False)


def test_an_executor_that_is_shut_down_meanwhile_keeps_what_has_come_back():
    pool = _Closing()

    def keep(solution):
        assert pool.refused.wait(60)
        return solution.state.q[2]

    with pytest.warns(UserWarning, match="The executor broke: .*after shutdown"):
        found = ts.ensemble(top.build(), TABLE, SPAN, executor=pool, keep=keep)
    assert found.interrupted
    assert 0 < found.success.sum() < 40


def test_a_client_of_dask_that_is_closed():
    distributed = pytest.importorskip("distributed")
    with distributed.Client(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        pass
    with pytest.raises(ts.InvalidArgument, match="executor: it takes no work: the client of Dask is closed"):
        ts.ensemble(top.build(), TABLE, SPAN, executor=client)
