"""Several vehicles with one ground station: each has a link and a system id, and obeys only its own commands."""

import math
import signal
import subprocess
import sys

import pytest
from fake_vehicle import free_port
from pymavlink import mavutil

from lapwing.cosim.log import LogReader
from lapwing.messages import OperatorInput, VehicleState
from lapwing.runs.resimulate import resimulate
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.links import for_vehicle_index

SETS = ("autopilot.follow_trajectory=false", "autopilot.parameters.MIS_TAKEOFF_ALT=1.5", "run.duration=900")


def next_message(station, kind, system, seconds=120.0):
    """Return the next message of a kind from a system."""
    while message := station.recv_match(type=kind, blocking=True, timeout=seconds):
        if message.get_srcSystem() == system:
            return message
    raise AssertionError(f"no {kind} from system {system}")


def send_command(station, system, number, *params):
    """Return the acknowledgement of a system to a command."""
    station.mav.command_long_send(system, 1, number, 0, *params, *[math.nan] * (7 - len(params)))
    while (ack := next_message(station, "COMMAND_ACK", system)).command != number:
        pass
    return ack.result


@pytest.mark.long
def test_each_system_obeys_its_own_commands(tmp_path):
    port, log = free_port(), tmp_path / "fleet.mcap"
    first, second = (mavutil.mavlink_connection(f"udpout:127.0.0.1:{port + i}") for i in range(2))
    sets = [part for each in SETS for part in ("--set", each)]
    more = ["--mavlink", f"udpin:127.0.0.1:{port}", "--speed", "2", "--log", str(log), "--key-prefix", "test-mav-fleet"]
    command = [sys.executable, "-m", "lapwing", "run", "fleet", *sets, *more]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        for station, system in ((first, 1), (second, 2)):
            while not station.recv_match(type="HEARTBEAT", blocking=True, timeout=0.5):
                assert process.poll() is None
                station.mav.heartbeat_send(6, 8, 0, 0, 0)
            assert next_message(station, "GLOBAL_POSITION_INT", system)  # the vehicle has started
        assert send_command(second, 2, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, 0.0) == mavlink.MAV_RESULT_ACCEPTED
        assert send_command(second, 2, mavlink.MAV_CMD_NAV_TAKEOFF) == mavlink.MAV_RESULT_ACCEPTED
        while next_message(second, "GLOBAL_POSITION_INT", 2).relative_alt < 1000:
            pass
        home = next_message(second, "HOME_POSITION", 2)
        assert (home.x, home.y) == (pytest.approx(-3.0, abs=0.1), pytest.approx(0.0, abs=0.1))  # north, east
        process.send_signal(signal.SIGINT)
    assert process.returncode == 130
    with LogReader(log) as read:
        assert read.complete
        reported = {
            name: [
                c.kind
                for *_, m in read.messages([f"/{name}/vehicle_command"])
                for c in OperatorInput.decode(m).commands
            ]
            for name in ("left", "right", "scout")
        }
        up = {
            name: max(VehicleState.decode(m).pose.position.z for *_, m in read.messages([f"/{name}/ground_truth"]))
            for name in reported
        }
    assert set(reported["left"]) | set(reported["scout"]) <= {"link"}  # a connected station
    assert {"arm", "takeoff"} <= set(reported["right"])
    assert up["right"] > 1.0 > max(up["left"], up["scout"])
    before, after = resimulate(log)
    assert before == after


@pytest.mark.parametrize(
    ("url", "links"),
    [
        ("udpout:127.0.0.1:14550", ["udpout:127.0.0.1:14550"] * 2),
        ("udpin:127.0.0.1:14540", ["udpin:127.0.0.1:14540", "udpin:127.0.0.1:14541"]),
        ("tcpin:127.0.0.1:5760", ["tcpin:127.0.0.1:5760", "tcpin:127.0.0.1:5761"]),
    ],
)
def test_listening_links_get_ports_and_sending_share(url, links):
    assert [for_vehicle_index(url, i) for i in range(2)] == links


@pytest.mark.parametrize(
    ("url", "text"),
    [
        ("serial:/dev/ttyS0:57600", "serves one vehicle; expected udpout, udpin or tcpin"),
        ("udpin:127.0.0.1:65535", "port 65535: the link of vehicle 1 would be at 65536"),
    ],
)
def test_impossible_fleet_link_is_rejected(url, text):
    with pytest.raises(ValueError, match=text):
        for_vehicle_index(url, 1)
