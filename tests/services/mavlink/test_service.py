"""MAVLink process of a run: telemetry and commands; it can neither stop nor slow the flight."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_vehicle import FakeVehicle, free_port, until
from pymavlink import mavutil

from lapwing.cosim.diagram.topic_encoder import to_record_batches
from lapwing.cosim.log import LogReader, LogWriter
from lapwing.cosim.transport.packets import pack_log_packet
from lapwing.messages import Status, header
from lapwing.messages.topics import STATUS
from lapwing.runs.single_process_run import fly_single
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.links import check
from lapwing.services.mavlink.service import _handle_log_packet
from lapwing.services.scene_resolver import load, resolve
from tests.endpoints import loopback_endpoints
from tests.participants import participants

pytestmark = pytest.mark.long

sys.path.insert(0, str(Path(__file__).parent))

HOVER = "lapwing/scenes/hover.toml"


def run(tmp_path, key_prefix, *more, **options):
    command = [sys.executable, "-m", "lapwing", "run", HOVER, "--key-prefix", key_prefix, *more]
    command += ["--log", str(tmp_path / f"{key_prefix}.mcap")]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)


def adapter_of(process):
    """Return the process id of a run's link once it has started."""
    assert until(lambda: "mavlink" in participants(process.pid), 120.0)
    return participants(process.pid)["mavlink"]


def next_message(connection, kind, seconds=120.0):
    message = connection.recv_match(type=kind, blocking=True, timeout=seconds)
    assert message, f"no {kind}"
    return message


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes in /proc")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_dead_or_stopped_link_does_not_delay_flight(tmp_path, how):
    port, key_prefix = free_port(), f"test-mavlink-{how.name.lower()}"
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    more = ["--mavlink", f"udpout:127.0.0.1:{port}", "--speed", "4"]
    with run(tmp_path, key_prefix, *more) as process:
        adapter = adapter_of(process)
        next_message(station, "ATTITUDE")
        os.kill(adapter, how)
        output, _ = process.communicate(timeout=600)
    station.close()
    assert process.returncode == 0, output
    if how == signal.SIGKILL:
        assert "mavlink: ended before the flight (signal 9)" in output
    with LogReader(tmp_path / f"{key_prefix}.mcap") as log:
        assert log.complete


@pytest.mark.parametrize(
    ("url", "fault"),
    [
        ("udpout:nowhere", "expected one of serial:DEVICE:BAUD, tcpin:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT"),
        ("pigeon:127.0.0.1:1", "expected one of serial"),
        ("udpin:127.0.0.1", "expected one of serial"),
        ("udpin:127.0.0.1:99999", "expected one of serial"),
    ],
)
def test_invalid_url_is_rejected_with_valid_forms(url, fault):
    with pytest.raises(ValueError, match=re.escape(f"--mavlink {url}: {fault}")):
        check(url)


def test_replayed_log_has_telemetry_but_rejects_commands(tmp_path):
    log = tmp_path / "flight.mcap"
    vehicle = FakeVehicle()
    vehicle.armed, vehicle.mode, vehicle.target = True, "takeoff", [0.0, 0.0, 30.0]
    with LogWriter(log, {}, {"scene.json": b'{"vehicle": {"name": "drone1"}}'}) as writer:
        for _ in range(300):
            for topic, message in vehicle.messages():
                writer.write(topic.key("drone1"), topic.message, message.encode(), vehicle.time_ns)
    port, (endpoint,) = free_port(), loopback_endpoints(["a"]).values()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    command = [sys.executable, "-m", "lapwing", "replay", str(log), "--key-prefix", "test-mavlink-replay"]
    command += ["--listen", endpoint, "--mavlink", f"udpout:127.0.0.1:{port}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        next_message(station, "HEARTBEAT")
        station.mav.heartbeat_send(6, 8, 0, 0, 0)
        station.mav.command_long_send(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
        assert next_message(station, "COMMAND_ACK").result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        while next_message(station, "GLOBAL_POSITION_INT").relative_alt < 500:
            pass
        process.terminate()
        process.communicate(timeout=300)
    station.close()


def test_flood_leaves_flight_bit_for_bit_identical(tmp_path):
    port, sent = free_port(), 0
    frame = mavlink.MAVLink_command_long_message(1, 1, 60_000, 0, *(0.0,) * 7).pack(mavlink.MAVLink(None, 255, 190))
    more = ["--mavlink", f"udpin:127.0.0.1:{port}", "--speed", "2"]
    with run(tmp_path, "test-mavlink-flood", *more) as process, socket.socket(type=socket.SOCK_DGRAM) as attacker:
        attacker.connect(("127.0.0.1", port))
        adapter_of(process)
        while process.poll() is None:
            for _ in range(200):  # about 100 000 a second
                try:
                    attacker.send(frame)
                    sent += 1
                except OSError:  # nothing listens yet, or the link has closed
                    break
            time.sleep(0.001)
        output, _ = process.communicate(timeout=600)
    assert process.returncode == 0, output
    assert sent > 10_000  # 100 000 a second on an idle machine
    assert re.search(r"\d+ above the rate limit", output), output
    assert re.search(r"mavlink: telemetry: jitter median [\d.]+ ms, p99 [\d.]+ ms", output)
    quiet = tmp_path / "quiet.mcap"
    fly_single(resolve(load(HOVER, ["autopilot.accept_commands=true"])), quiet)
    with LogReader(tmp_path / "test-mavlink-flood.mcap") as flooded, LogReader(quiet) as read:
        assert flooded.digest() == read.digest()


def test_mission_of_plan_can_be_downloaded(tmp_path):
    port = free_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")
    more = ["--mavlink", f"udpout:127.0.0.1:{port}", "--plan", "lapwing/scenes/plans/delivery.plan", "--speed", "2"]
    with run(tmp_path, "test-mavlink-plan", *more) as process:
        next_message(station, "HEARTBEAT")
        station.mav.mission_request_list_send(1, 1, 0)
        result = []
        for number in range(next_message(station, "MISSION_COUNT").count):
            station.mav.mission_request_int_send(1, 1, number, 0)
            result.append(next_message(station, "MISSION_ITEM_INT"))
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=300)
    station.close()
    assert [m.command for m in result] == [178, 22, 16, 16, 16, 16, 21]  # as in the file
    assert result[5].param1 == 5.0
    assert result[4].z == pytest.approx(
        10.0, abs=0.02
    )  # above home; the body origin at rest is 0.35 m above the ground


def test_statuses_of_different_lengths_are_handled_in_order():
    modes = ("hold", "land", "position_control", "land", "hold")  # their messages have two lengths
    messages = [(STATUS, tick, Status(header(tick, "world"), mode, mode).encode()) for tick, mode in enumerate(modes)]
    pages = to_record_batches(messages)
    assert len(pages) == 2
    handled = []
    server = SimpleNamespace(handle=lambda *message: handled.append(message))
    _handle_log_packet({"drone1": server}, pack_log_packet(pages, 0, 5), True, 1)
    assert [time_ns for _, time_ns, _ in handled] == [0, 1, 2, 3, 4]
    assert tuple(STATUS.message.decode(payload).mode for *_, payload in handled) == modes
