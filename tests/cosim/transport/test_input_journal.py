"""A service that is started again: what it had been given, and what was lost on the way."""

import os
import random
import tempfile

import numpy as np
import pytest

from lapwing.cosim.diagram.topic_encoder import RecordBatch, later
from lapwing.cosim.processes.restart_policy import MOST, Restarts
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.input_journal import NOTHING, Held, Journal, Refilled
from lapwing.messages.topics import TRUTH

STEP = 1_000_000  # [ns] of a tick


@pytest.fixture
def journal():
    """Makes the journal of a process, each time of the same file."""
    with tempfile.TemporaryFile() as file:
        yield lambda: Journal("sensors", file.fileno())


def given(tick):
    return [(tick * STEP, bytes([tick]) * 3), NOTHING]


def stepped(journal, ticks):
    for tick in ticks:
        for message in given(tick):
            assert journal.take(lambda message=message: message) == message
        journal.write(tick, b"bundle %d" % tick)


def again(journal):
    """The ticks that are stepped once more; asserts that each is given what it was given before."""
    found = []
    for tick in journal.recall():
        assert [journal.take(pytest.fail) for _ in given(tick)] == given(tick)
        journal.write(tick, b"bundle %d" % tick)
        found.append(tick)
    return found


def test_a_new_journal_recalls_nothing(journal):
    assert again(journal()) == []


def test_what_was_given_is_given_again_and_the_journal_goes_on(journal):
    stepped(journal(), range(5))
    second = journal()
    assert again(second) == [0, 1, 2, 3, 4]
    stepped(second, range(5, 8))
    assert again(journal()) == list(range(8))


def test_a_tick_that_was_not_written_to_its_end_is_left_out(journal):
    first = journal()
    stepped(first, range(5))
    size = os.fstat(first._file).st_size
    for cut in range(1, 40):
        os.ftruncate(first._file, size - cut)
        second = journal()
        assert again(second) == [0, 1, 2, 3]
        stepped(second, [4])
        assert again(journal()) == [0, 1, 2, 3, 4]


def test_a_service_that_gives_something_else_when_it_is_stepped_again_is_named(journal):
    stepped(journal(), range(3))
    second = journal()
    ticks = second.recall()
    next(ticks)
    for _ in given(0):
        second.take(pytest.fail)
    with pytest.raises(LockStepError, match="sensors: gives something else at tick 0 when it is stepped again"):
        second.write(0, b"another bundle")


def test_a_service_that_asks_for_something_else_is_named(journal):
    stepped(journal(), range(3))
    second = journal()
    next(second.recall())
    for _ in given(0):
        second.take(pytest.fail)
    with pytest.raises(LockStepError, match="sensors: asks for something else"):
        second.take(pytest.fail)


@pytest.mark.parametrize("seed", range(30))
def test_bundles_that_were_lost_or_come_twice_are_taken_once_each_in_their_order(seed):
    chance = random.Random(seed)
    held, sent = Held(1000), []
    for tick in range(200):
        sent.append((tick * STEP, b"%d" % tick if tick < 199 else b""))
        held.add(sent[-1][1], sent[-1][0])
    arrive = [bundle for bundle in sent for _ in range(chance.choice((0, 1, 1, 2)))]
    refilled = Refilled(lambda timeout: arrive.pop(0) if arrive else None, held.since)
    assert [refilled.get(0.0, tick * STEP) for tick in range(200)] == sent


def test_the_end_comes_where_the_next_bundle_is_due_later():
    held = Held(10)
    held.add(b"0", 0)
    held.add(b"", 3 * STEP)  # a service that gives something at every fourth tick
    refilled = Refilled(lambda timeout: None, held.since)
    assert refilled.get(0.0, 0) == (0, b"0")
    assert refilled.get(0.0, 4 * STEP) == (3 * STEP, b"")


def test_a_bundle_that_nobody_has_any_more_is_not_waited_for():
    held = Held(10)
    for tick in range(50):
        held.add(b"bundle", tick * STEP)
    refilled = Refilled(lambda timeout: (49 * STEP, b"bundle"), held.since)
    assert refilled.get(0.0, 7 * STEP) == (49 * STEP, b"bundle")  # from which the lock step says what is missing


def test_nothing_is_there_while_a_service_is_being_started():
    assert Refilled(lambda timeout: None, lambda words: None).get(0.0, 0) is None


def test_many_bundles_are_given_again_in_several_answers():
    held = Held(1000)
    for tick in range(100):
        held.add(bytes(100_000), tick * STEP)
    assert len(held.since("0")) < 2_000_000
    refilled = Refilled(lambda timeout: None, held.since)
    assert all(refilled.get(0.0, tick * STEP) == (tick * STEP, bytes(100_000)) for tick in range(100))


def test_pages_from_a_tick_on():
    page = RecordBatch(TRUTH, np.arange(0, 20, 2), np.arange(10))
    assert later([page], 0) == [page]
    assert later([page], 19) == []
    (rest,) = later([page], 7)
    assert rest.ticks.tolist() == [8, 10, 12, 14, 16, 18]
    assert rest.payloads.tolist() == [4, 5, 6, 7, 8, 9]


class Watch:
    """A run at 1.5 s."""

    time_ns, diverged = 1_500_000_000, False

    def __init__(self):
        self.told, self.forgotten = [], []

    def publish(self, key, time_ns, payload):
        self.told.append((key, payload.decode()))

    def forget(self, name):
        self.forgotten.append(name)


def test_a_service_is_started_again_three_times_and_each_time_is_told():
    watch, said = Watch(), []
    restarts = Restarts({"sensors": 7}, said.append)
    assert restarts.journal("sensors") == (7,)
    assert restarts.journal("plant") == ()
    assert [restarts.begin("sensors", -9, watch) for _ in range(MOST + 1)] == [True] * MOST + [False]
    assert said == ["sensors was killed (signal 9) at t = 1.500 s, and is started again"] * MOST
    assert watch.told[0] == ("_restarted/mission", '[[1.5, "sensors was killed (signal 9), and is started again"]]')
    assert watch.forgotten == ["sensors"] * MOST


def test_who_ends_by_itself_or_is_not_named_is_not_started_again():
    restarts = Restarts({"sensors": 7}, lambda line: None)
    assert not restarts.begin("sensors", 1, Watch())
    assert not restarts.begin("sensors", 0, Watch())
    assert not restarts.begin("plant", -9, Watch())
    assert restarts.may(["sensors"])
    assert not restarts.may(["sensors", "plant"])
