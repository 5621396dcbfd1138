"""MAVLink messages of user modules."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink import mavutil

from lapwing.cosim.scene import SceneError
from lapwing.services.mavlink.session import Schedule
from lapwing.services.mavlink.telemetry.message_stream import STREAMS
from lapwing.services.mavlink.vehicle_cache import VehicleCache
from lapwing.services.scene_resolver import load, resolve

GUIDE = Path("docs/guides/extensions.md").read_text().partition("## MAVLink messages")[2]
MODULE = re.search(r"```python\n(.*?)```", GUIDE, re.DOTALL)[1].replace("estimate.angles[0]", "0.25")
NUMBER = 251  # NAMED_VALUE_FLOAT


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.delitem(STREAMS, NUMBER, raising=False)
    monkeypatch.delitem(sys.modules, "own_messages", raising=False)
    path = tmp_path / "hover.toml"
    path.write_text(load("groundstation").path.read_text() + '\n[mavlink]\nmodule = "own_messages"\n')

    def loaded(text=MODULE):
        (tmp_path / "own_messages.py").write_text(text)
        return load(path)

    yield loaded
    STREAMS.pop(NUMBER, None)


def test_user_message_is_sent_at_its_rate(scene):
    config = resolve(scene(MODULE.replace("estimate and ", "")))
    assert "@stream" in config.modules["own_messages"]
    vehicle = VehicleCache(config.auxiliary["mavlink"])
    schedule, sent = Schedule(vehicle), 0
    for k in range(1000):  # 10 s
        vehicle.time_ns = k * 10_000_000
        sent += sum(m.get_type() == "NAMED_VALUE_FLOAT" and m.value == 0.25 for m in schedule.due({}))
    assert sent == 50


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 +", "mavlink.module: own_messages.py, line 1: invalid syntax"),
        (MODULE.replace("NAMED_VALUE_FLOAT", "NAMED_VALUE_FLAOT"), "mavlink.module: own_messages declares no message"),
    ],
)
def test_invalid_module_is_rejected(scene, text, message):
    with pytest.raises(SceneError, match=message):
        scene(text)


@pytest.mark.long
def test_command_sends_user_message(scene, tmp_path):
    scene()
    station = mavutil.mavlink_connection("udpin:127.0.0.1:0")
    port = station.port.getsockname()[1]
    command = [sys.executable, "-m", "lapwing", "run", "hover.toml", "--set", "run.duration=4.0", "--log", "log.mcap"]
    command += ["--mavlink", f"udpout:127.0.0.1:{port}"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        message = station.recv_match(type="NAMED_VALUE_FLOAT", blocking=True, timeout=500)
        _, error = run.communicate(timeout=600)
    station.close()
    assert message is not None, error
    assert (message.name, message.value) == ("roll", 0.25)
