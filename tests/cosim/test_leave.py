"""Nobody leaves a run before the others have confirmed its last message, or have left."""

import threading
from collections import Counter
from contextlib import contextmanager

import pytest

import lapwing.cosim.executors.participant
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
def joined(monkeypatch, external=()):
    """A process that has joined, and the session of the only other participant, which has said that it is there."""
    monkeypatch.setattr(lapwing.cosim.executors.participant.signal, "signal", lambda *_: None)
    monkeypatch.setattr(lapwing.cosim.executors.participant, "on_compile", lambda told: None)
    with private_endpoints(["plant"]) as endpoints, ZenohBus([endpoints["plant"]], awaits=False) as bus:
        process = Participant("plant", SETUP, bus, PublisherIds(PREFIX, external=external), ["plant", "other"])
        with ZenohBus(connect=[endpoints["plant"]]) as other:
            other.declare_alive(f"{PREFIX}/{ALIVE_KEY}/other")
            process.join()
            yield process, other


def test_who_does_not_confirm_is_named(monkeypatch):
    monkeypatch.setattr(lapwing.cosim.executors.participant, "CONFIRMED", 0.1)
    with (
        joined(monkeypatch) as (process, _),
        pytest.raises(LockStepError, match=r"^plant: other did not confirm its last"),
    ):
        process.leave(lambda: None)


def test_a_last_message_is_repeated_until_it_is_confirmed(monkeypatch):
    said, heard = Counter(), threading.Event()
    with joined(monkeypatch) as (process, other):

        def repeat():
            said["end"] += 1
            if said["end"] == 3:
                other.declare_alive(f"{PREFIX}/{HEARD_KEY}/other")
                heard.set()

        process.leave(repeat)
    assert heard.is_set()


def test_who_has_left_is_not_waited_for(monkeypatch):
    with joined(monkeypatch) as (process, other):
        process.leave(other.close)


def test_a_program_of_another_author_confirms_by_leaving_or_is_late(monkeypatch):
    monkeypatch.setattr(lapwing.cosim.executors.participant, "FOREIGN", 0.1)
    with joined(monkeypatch, external=("other",)) as (process, _):
        process.leave(lambda: None)
