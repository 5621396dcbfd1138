"""Link to ArduPilot against a scripted peer: lock step, resent frames, restarts, stalls and hostile packets."""

import math
import socket
import time

import pytest

from lapwing.services.ardupilot.link import MAVLINK_PORT, PEER_TIMEOUT, STRIDE, ArduPilotLink
from lapwing.services.ardupilot.resolve import ArduPilotConfig
from lapwing.services.common import ports
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.ports import BatteryReading, TrueState
from tests.services.ardupilot.peer import ArduPilotPeer, servo_packet
from tests.services.firmware_links import Background, link_with, never

OWN = ArduPilotConfig(Datum(), (0.0, 0.0, -9.80665), 250.0, False, "", False, False, {})


SAMPLES = {ports.TRUTH: TrueState(position_world=(1.0, 2.0, 3.0)), ports.BATTERY: BatteryReading(1.0, 11.1, 2.0)}


@pytest.fixture
def link():
    link = link_with(ArduPilotLink, OWN, SAMPLES)
    yield link
    link.close()


def fly(link, steps, first=0):
    return [link.steps.step(tick) for tick in range(first, first + steps)]


def begin(link, script):
    """Run a script with a peer in the background, and open the link."""
    peer = ArduPilotPeer(link.address[1])
    background = Background(script, peer)
    link.open(never)
    return background


def flight(link, script, steps):
    """Run a script with a peer during `steps`, answer its last frame. Return the outputs, and the script's result."""
    background = begin(link, script)
    outputs = fly(link, steps)
    link._send()
    return outputs, background.join()


@pytest.mark.long
def test_every_step_is_answered(link):
    def script(peer):
        return [peer.exchange((1000 + k,) * 4 + (0,) * 12) for k in range(101)]

    outputs, states = flight(link, script, 100)
    assert [s["timestamp"][0] for s in states[:100]] == pytest.approx([0.004 * k for k in range(1, 101)], abs=1e-6)
    assert states[0]["position"] == [2.0, 1.0, -3.0]
    assert states[0]["accel_body"] == pytest.approx([0.0, 0.0, -9.80665])
    assert [o.outputs[0] for o in outputs] == pytest.approx([1e-3 * k for k in range(1, 101)])
    assert (link.report.resent, link.report.missed, link.report.rejected, link.report.skew_max) == (0, 0, 0, 0.0)


def test_clock_of_whole_microseconds_does_not_drift(link):
    """ArduPilot adds the difference of two timestamps to a clock of whole microseconds, and truncates the rest."""

    def script(peer):
        clock, last = 0, 0.0
        for _ in range(2001):
            time_s = peer.exchange()["timestamp"][0]
            clock, last = int(clock + (time_s - last) * 1e6), time_s
        return clock

    _, result = flight(link, script, 2000)
    assert result == 2000 * 4000


def test_resent_frame_is_answered_without_step(link):
    def script(peer):
        peer.exchange()
        states = []
        for _ in range(3):  # the frame of count 1 three times
            peer.send(servo_packet(1))
            states.append(peer.receive(5.0))
        peer.count = 2
        peer.exchange()
        return states

    _, states = flight(link, script, 2)
    assert len(set(states)) <= 2
    assert link.report.resent == 2


def test_frame_resent_before_answer_does_not_delay_later_steps(link):
    """Check that each frame has one answer: ArduPilot uses each datagram for its newest frame."""

    def script(peer):
        peer.exchange()
        for _ in range(2):  # the peer sends frame 1 three times before it is answered
            peer.send(servo_packet(1))
        return [peer.exchange()["timestamp"][0] for _ in range(5)]

    _, result = flight(link, script, 5)
    assert result == pytest.approx([0.004 * k for k in (2, 3, 4, 5, 5)], abs=1e-6)
    assert link.report.resent == 2


def test_malformed_packets_are_counted_and_reported(link):
    def script(peer):
        peer.exchange()
        for data in (b"x", servo_packet(9, magic=1), servo_packet(9)[:-1], servo_packet(9, (65535,) * 16)):
            peer.send(data)
        peer.exchange()
        peer.exchange()

    flight(link, script, 2)
    assert link.report.rejected == 4
    assert "magic number 1, expected 18458 or 29569" in " ".join(link.report.notes)


def test_restart_with_same_address_is_counted(link):
    def script(peer):
        for _ in range(5):
            peer.exchange()
        peer.count = 0
        for _ in range(5):
            peer.exchange()

    flight(link, script, 9)
    assert link.report.reconnected == 1


def test_second_firmware_is_rejected_while_first_runs(link):
    def script(peer):
        peer.exchange()
        other = ArduPilotPeer(link.address[1])
        other.send(servo_packet(0))
        time.sleep(0.05)
        peer.exchange()
        peer.exchange()
        return other.receive(0.1)

    _, result = flight(link, script, 2)
    assert result is None
    assert link.report.rejected == 1
    assert "another ArduPilot" in link.report.notes[0]


def test_restarted_firmware_with_new_address_takes_over(link):
    def script(peer):
        peer.exchange()
        peer.exchange()
        peer.close()
        time.sleep(PEER_TIMEOUT + 0.1)
        other = ArduPilotPeer(link.address[1])
        return [other.exchange() for _ in range(3)]

    _, states = flight(link, script, 4)
    assert link.report.reconnected == 1
    assert states[0]["timestamp"][0] >= 0.008 - 1e-6  # the plant continues from its state


def test_mavlink_client_connects_to_restarted_firmware(link):
    """ArduPilot waits at every start until a client has connected to its first MAVLink port."""

    def script(peer):
        peer.exchange()
        peer.exchange()
        peer.close()
        with socket.create_server(("127.0.0.1", MAVLINK_PORT + STRIDE * link._config.instance)) as server:
            server.settimeout(20.0)
            with server.accept()[0]:
                other = ArduPilotPeer(link.address[1])
                return [other.exchange() for _ in range(3)]

    link._config = link._config._replace(step_timeout=15.0)
    flight(link, script, 4)
    assert link.report.reconnected == 1


def test_stall_is_reported(link):
    link._config = link._config._replace(step_timeout=0.5)
    background = begin(link, lambda peer: peer.exchange())
    with pytest.raises(
        FirmwareError,
        match=r"ardupilot: no servo packet for 0.5 s at t = 0.00[04] s; .*, or raise autopilot.step_timeout",
    ):
        fly(link, 3)
    background.join()


def test_absent_firmware_is_reported(link):
    link._config = link._config._replace(start_timeout=0.5)
    with pytest.raises(FirmwareError, match=r"no servo packet for 0.5 s at its start; start arducopter"):
        link.open(never)


def test_mavlink_port_is_tried_until_it_listens(link):
    """ArduPilot waits at its start until a client has connected to its first MAVLink port."""

    def script(peer):
        time.sleep(1.0)
        with socket.create_server(("127.0.0.1", MAVLINK_PORT + STRIDE * link._config.instance)) as server:
            server.settimeout(20.0)
            server.accept()[0].close()
        return peer.exchange()

    begin(link, script)


def test_port_in_use_is_reported(link):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(link.address)
        with pytest.raises(FirmwareError, match=r"cannot listen on udp 127.0.0.1:.*in use"):
            link.open(never)


def test_slow_loop_rate_is_reported(link):
    begin(link, lambda peer: peer.exchange(rate=400))
    assert "SIM_RATE_HZ is 400" in link.report.notes[0]


def test_non_finite_state_ends_run(link):
    begin(link, lambda peer: peer.exchange())
    with pytest.raises(ValueError, match="not finite"):
        link.steps.step(0, truth=TrueState(position_world=(math.nan, 0.0, 0.0)))
