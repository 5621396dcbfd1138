"""Locks of kernels: waiting time of a process while another process compiles the same kernel."""

import os
from types import SimpleNamespace

import pytest

from lapwing.kernels.compiler import cache_files, file_locks

HELD = 300  # [s] until the holder releases the lock, more than `PATIENCE`


@pytest.fixture
def seconds_waited(tmp_path, monkeypatch):
    """Return a function that waits for a held lock in simulated time; `work` returns the holder's work at a time."""
    monkeypatch.setattr(cache_files, "root", lambda: tmp_path)

    def wait(work):
        now = [0.0]
        with file_locks.release_at_end():
            file_locks.acquire("kernel")
            (lock,) = file_locks._held.locks

            def sleep(_):
                now[0] += 1.0
                if now[0] == HELD:
                    lock.path.unlink()
                    file_locks.os.close(lock.descriptor)
                    file_locks._held.locks.remove(lock)

            monkeypatch.setattr(file_locks, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
            monkeypatch.setattr(file_locks, "_work_of_holder", lambda path: work(now[0]))
            file_locks.acquire("kernel")
        return now[0]

    return wait


def test_lock_waits_for_working_process(seconds_waited):
    assert seconds_waited(lambda now: str(now // 100.0)) == HELD


def test_lock_does_not_wait_for_idle_process(seconds_waited):
    assert seconds_waited(lambda now: "7 3") == pytest.approx(file_locks.PATIENCE, abs=1.0)


def test_wait_for_process_of_other_container_ends(seconds_waited, monkeypatch):
    monkeypatch.setattr(file_locks, "LONGEST", 200.0)
    assert seconds_waited(str) == pytest.approx(200.0, abs=1.0)


def test_work_of_holder_is_processor_time(tmp_path, monkeypatch):
    monkeypatch.setattr(cache_files, "root", lambda: tmp_path)
    with file_locks.release_at_end():
        file_locks.acquire("kernel")
        path = file_locks._held.locks[0].path
        before = file_locks._work_of_holder(path)
        if not before:
            pytest.skip("finds processes in /proc")
        while file_locks._work_of_holder(path) == before:
            pass
    assert file_locks._work_of_holder(path) == ""


def test_process_id_of_killed_holder_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setattr(cache_files, "root", lambda: tmp_path)
    with file_locks.release_at_end():
        file_locks.acquire("kernel")
        path = file_locks._held.locks[0].path
    path.write_text("4194304" * 3)
    with file_locks.release_at_end():
        file_locks.acquire("kernel")
        assert int(path.read_text()) == os.getpid()
