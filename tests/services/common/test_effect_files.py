"""Files of effects, and addresses."""

import math
from pathlib import Path

import pytest

from lapwing.cosim.scene import SceneError
from lapwing.services.common.address import host_and_port, is_loopback
from lapwing.services.common.schemas.vehicle_schema import rotor_constants
from lapwing.services.scene_resolver import load

TABLE = '[effects.rotor_table]\nfile = "prop.txt"'


@pytest.fixture
def path(tmp_path):
    result = tmp_path / "table.toml"
    result.write_text(Path("lapwing/scenes/hover.toml").read_text().replace("[effects.rotor_thrust]", TABLE))
    return result


def test_rotor_constants_come_from_table(path):
    path.with_name("prop.txt").write_text("J CT CP\n0.0 0.10 0.04\n0.2 0.08 0.04\n")
    scene = load(path)
    path.with_name("prop.txt").unlink()
    result = rotor_constants(scene)
    assert result.thrust == pytest.approx(0.1 * 0.5588**4 / (4 * math.pi**2))
    assert result.with_density


def test_missing_or_incomplete_table_is_rejected(path):
    with pytest.raises(SceneError, match=r"effects.rotor_table.file: .*prop.txt: no such file"):
        load(path)
    path.with_name("prop.txt").write_text("J CT CP\n0.0 0.10 0.04\n0.2 0.08\n")
    with pytest.raises(SceneError, match=r"effects.rotor_table.file: expected 3 as its first line, got line 3|line 3"):
        load(path)


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
