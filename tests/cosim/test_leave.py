"""Participants leave a run once the others have confirmed their last message or left."""

import queue
import threading
from collections import Counter
from contextlib import contextmanager

import pytest

import lapwing.cosim.executors.participant
import lapwing.cosim.executors.peer_tracker
import lapwing.cosim.executors.stop_request
from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.executors.participant import Participant
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, HEARD_KEY

PREFIX = "test-leave"
SETUP = RunConfig("", "", 1, 1, 250, 4_000_000, "gauss_seidel", "drone1", {}, {}, {})


@contextmanager
def participant(monkeypatch, external=()):
    """Yield a participant that has not joined, and its endpoint."""
    monkeypatch.setattr(lapwing.cosim.executors.stop_request.signal, "signal", lambda *_: None)
    monkeypatch.setattr(lapwing.cosim.executors.participant, "on_compile", lambda messages: None)
    with private_endpoints(["plant"]) as endpoints, ZenohBus([endpoints["plant"]], awaits=False) as bus:
        yield (
            Participant("plant", SETUP, bus, PublisherIds(PREFIX, external=external), ["plant", "other"]),
            endpoints["plant"],
        )


@contextmanager
def joined(monkeypatch, external=()):
    """Yield a joined participant, and the session of the only other one."""
    with participant(monkeypatch, external) as (process, endpoint), ZenohBus(connect=[endpoint]) as other:
        other.declare_liveliness(f"{PREFIX}/{ALIVE_KEY}/other")
        process.join()
        yield process, other


def test_missing_confirmation_is_named(monkeypatch):
    monkeypatch.setattr(lapwing.cosim.executors.participant, "CONFIRMED", 0.1)
    with (
        joined(monkeypatch) as (process, _),
        pytest.raises(LockStepError, match=r"^plant: other did not confirm its last"),
    ):
        process.leave(lambda: None)


def test_supervised_participant_waits_as_long_as_its_supervisor(monkeypatch):
    monkeypatch.setattr(lapwing.cosim.executors.participant, "CONFIRMED", 0.1)
    with joined(monkeypatch) as (process, other):
        process.supervised = True
        threading.Timer(1.0, lambda: other.declare_liveliness(f"{PREFIX}/{HEARD_KEY}/other")).start()
        process.leave(lambda: None)


def test_last_message_is_repeated_until_confirmed(monkeypatch):
    output, received = Counter(), threading.Event()
    with joined(monkeypatch) as (process, other):

        def repeat():
            output["end"] += 1
            if output["end"] == 3:
                other.declare_liveliness(f"{PREFIX}/{HEARD_KEY}/other")
                received.set()

        process.leave(repeat)
    assert received.is_set()


def test_participant_that_has_left_is_not_awaited(monkeypatch):
    with joined(monkeypatch) as (process, other):
        process.leave(other.close)


def test_external_service_confirms_by_leaving_or_timeout(monkeypatch):
    monkeypatch.setattr(lapwing.cosim.executors.peer_tracker, "EXTERNAL_GRACE", 0.1)
    with joined(monkeypatch, external=("other",)) as (process, _):
        process.leave(lambda: None)


def test_participant_that_left_before_another_looked_counts_as_joined(monkeypatch):
    monkeypatch.setattr(lapwing.cosim.executors.participant, "JOIN_TIMEOUT", 5.0)
    with participant(monkeypatch) as (process, endpoint):
        bus = process.bus
        declare = bus.declare_liveliness

        def declare_late(key):
            undeclare, changes = declare(key), queue.SimpleQueue()
            bus.watch_liveliness(f"{PREFIX}/{ALIVE_KEY}/other", lambda key, alive: changes.put(alive))
            with ZenohBus(connect=[endpoint]) as other:
                other.declare_liveliness(f"{PREFIX}/{ALIVE_KEY}/other")
                assert changes.get(timeout=60.0)
            assert not changes.get(timeout=60.0)
            return undeclare

        monkeypatch.setattr(bus, "declare_liveliness", declare_late)
        process.join()
