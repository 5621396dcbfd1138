"""Parsing of HOST:PORT addresses."""

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
def test_address_is_split_into_host_and_port(text, expected):
    assert host_and_port(text) == expected


@pytest.mark.parametrize("host", ["127.0.0.1", "127.8.0.1", "::1", "localhost"])
def test_loopback_host_is_recognised(host):
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.1", "robot", "localhost.org", "127.0.0.1.org", ""])
def test_remote_host_is_not_loopback(host):
    assert not is_loopback(host)
