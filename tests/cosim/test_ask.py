"""Queries on the bus."""

from lapwing.cosim.transport.bus import ZenohBus
from tests.endpoints import absent, loopback_endpoints

KEYS = ["test/_alive/responder"]


def test_query_returns_payload_or_none():
    (endpoint,) = loopback_endpoints(["responder"]).values()
    with ZenohBus([endpoint]) as responder, ZenohBus(connect=[endpoint]) as client:
        responder.answer("test/_setup/responder", b"payload")
        responder.declare_liveliness(KEYS[0])
        assert not absent(client, KEYS, 20.0)
        assert client.query("test/_setup/responder", 20.0) == b"payload"
        assert client.query("test/_setup/missing", 20.0) is None
