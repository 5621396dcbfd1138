"""Addresses HOST:PORT, and which of them only this machine reaches."""

import pytest

from lapwing.services.common.address import host_and_port, is_loopback


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("127.0.0.1:8765", ("127.0.0.1", 8765)),
        ("robot.local:1", ("robot.local", 1)),
        ("[::1]:7447", ("::1", 7447)),
        ("host:65535", ("host", 65535)),
        ("host:65536", None),
        ("host", None),
        ("host:", None),
        (":7447", None),
        ("a b:1", None),
        ("host:x", None),
    ],
)
def test_an_address_is_taken_apart(text, expected):
    assert host_and_port(text) == expected


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.0.1", "::1", "localhost"])
def test_this_machine_alone(host):
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.1", "robot", "localhost.org", "127.0.0.1.org", ""])
def test_others_too(host):
    assert not is_loopback(host)
