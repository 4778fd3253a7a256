"""Workers and schedulers that are killed at work: the same results, or one message and the same results next time."""

import signal
import time

import numpy as np
import pytest

from lab.cluster import LARGE, executor_of
from scene.errors import ClusterError

DIES = """
def die(count):
    if count == 4:
        open(os.path.join(os.path.dirname(__file__), "died"), "w").close()
        os.kill(os.getpid(), signal.SIGKILL)

on_open("flash_", die)
"""
WAITS = """
def wait(count):
    end = time.monotonic() + 60
    while not os.path.exists(os.path.join(os.path.dirname(__file__), "..", "worker-0", "died")):
        assert time.monotonic() < end
        time.sleep(0.02)

on_open("flash_", wait)
"""
"""It leaves the work to the first worker until that one has died: a quick one would do all of it."""
DIES_OF_ONE = 'on_open("flash_05", lambda count: os.kill(os.getpid(), signal.SIGKILL))'


@pytest.mark.full
def test_the_units_of_a_killed_worker_are_done_by_others(session, cluster, same, tmp_path):
    cluster.start_scheduler()
    dies = cluster.start_worker(habit=DIES)
    cluster.start_worker(habit=WAITS)
    done = cluster.solve(session[0], tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert dies.wait(timeout=10) == -signal.SIGKILL, "killed with a unit in its hands"
    same(tmp_path / "out")


@pytest.mark.full
def test_a_unit_that_kills_its_workers_ends_with_a_message(session, cluster, same, refused, tmp_path):
    cluster.start_scheduler(DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1")
    workers = [cluster.start_worker(habit=DIES_OF_ONE) for _ in range(3)]
    refused(cluster.solve(session[0], tmp_path / "out"), "2 workers died", "memory", "What is done is kept")
    assert sum(worker.poll() is not None for worker in workers) == 2, "no more are spent on it"
    workers[0].kill()
    for worker in workers:
        worker.kill()
        worker.wait()
    cluster.start_worker()
    assert cluster.solve(session[0], tmp_path / "out").returncode == 0
    same(tmp_path / "out")


@pytest.mark.full
def test_a_scheduler_that_is_killed_ends_the_run_with_one_message(session, cluster, same, refused, tmp_path):
    cluster.start_scheduler()
    cluster.start_worker(habit=cluster.SLOW)
    run = cluster.begin(session[0], tmp_path / "out")
    cluster.scheduler.send_signal(signal.SIGKILL)
    start = time.monotonic()
    refused(cluster.finish(run), "the scheduler was lost", "What is done is kept: run the same command again")
    assert time.monotonic() - start < 30
    cluster.scheduler.wait()
    cluster.start_scheduler()
    cluster.start_worker()
    done = cluster.solve(session[0], tmp_path / "out")
    assert done.returncode == 0, done.stderr
    same(tmp_path / "out")


@pytest.mark.full
def test_a_run_without_workers_waits_no_longer_than_it_says(cluster, monkeypatch, capsys):
    monkeypatch.setattr("lab.cluster.WAIT_S", 2)
    cluster.start_scheduler()
    with pytest.raises(ClusterError, match="it had no worker for 2 s") as told, executor_of(cluster.address):
        pass
    assert f"dask worker {cluster.address}" in str(told.value)
    assert "waiting for workers" in capsys.readouterr().err


@pytest.mark.full
def test_a_unit_that_fails_or_is_cancelled_costs_the_others_nothing(cluster, tmp_path):
    cluster.start_scheduler()
    cluster.start_worker()
    shared = tmp_path / ".rgbn" / "cluster"
    with executor_of(cluster.address, tmp_path) as executor:
        assert executor.submit(np.sum, np.ones(LARGE)).result() == LARGE
        assert shared.is_dir()
        units = [executor.submit(time.sleep, 0.5), executor.submit(int, "x"), executor.submit(time.sleep, 60)]
        assert units[2].cancel()
        assert list(executor.map(len, ["a", "bc"])) == [1, 2]
        with pytest.raises(ValueError, match="invalid literal"):
            units[1].result()
    assert not shared.exists()
