"""Answers on the bus: to words that are understood, with the mark of who gives them."""

from lapwing.cosim.transport.bus import ZenohBus
from tests.endpoints import loopback_endpoints

MARK, OTHER = b"m" * 16, b"o" * 16
KEYS = ["test/_alive/giver"]


def test_who_asks_is_answered_by_the_right_participant_only():
    (endpoint,) = loopback_endpoints(["giver"]).values()
    with ZenohBus([endpoint], mark=MARK) as giver, ZenohBus(connect=[endpoint]) as asker:
        giver.answer("test/_held/giver", lambda words: b"from %d" % int(words))
        giver.declare_alive(KEYS[0])
        assert asker.wait_alive(KEYS, 20.0) == []
        assert asker.ask("test/_held/giver", 20.0, "7") == b"from 7"
        assert asker.ask("test/_held/giver", 20.0, "7", MARK) == b"from 7"
        assert asker.ask("test/_held/giver", 20.0, "7", OTHER) is None
        assert asker.ask("test/_held/giver", 20.0, "seven", MARK) is None
        assert giver.refused == 1
        assert asker.ask("test/_held/giver", 20.0, "8", MARK) == b"from 8"
        assert asker.ask("test/_held/nobody", 20.0, "7") is None
