"""Link to PX4 against a scripted peer: free-wheel start, lock step, stalls, reconnects and hostile streams."""

import itertools
import math
import socket
import time
from contextlib import suppress

import pytest
from pymavlink.dialects.v20 import all as mavlink

from lapwing.services.common import ports
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.ports import BarometerReading, BatteryReading, GpsReading, ImuReading, MagnetometerReading
from lapwing.services.px4.link import MAVLINK_PORT, PORT, Px4Link
from lapwing.services.px4.resolve import Px4Config
from tests.services.firmware_links import Background, link_with, never
from tests.services.px4.peer import Px4Peer, finite

PERIODS = {ports.IMU: 1, ports.MAGNETOMETER: 5, ports.BAROMETER: 5, ports.GPS: 25}
OWN = Px4Config(Datum(), PERIODS, (0.0, 0.0, 9.81), (1e-6, 2.4e-5, -3.9e-5), 98000.0, {})
SAMPLES = {
    ports.IMU: ImuReading((0.1, 0.2, 0.3), (0.0, 0.0, 9.81), valid=True),
    ports.MAGNETOMETER: MagnetometerReading((2e-5, 1e-6, -4e-5), valid=True),
    ports.BAROMETER: BarometerReading(98000.0, valid=True),
    ports.GPS: GpsReading(40.0, 14.0, 280.0, valid=True),
    ports.BATTERY: BatteryReading(),
}


@pytest.fixture
def link():
    link = link_with(Px4Link, OWN, SAMPLES)
    yield link
    link.close()


def port_of(link):
    return PORT + link._config.instance


def fly(link, steps, first=0, samples=SAMPLES):
    return [link.steps.step(tick, **samples) for tick in range(first, first + steps)]


def begin(link, script):
    """Run a script with a started peer in the background, and open the link."""

    def run():
        peer = Px4Peer(port_of(link))
        first = peer.start()
        peer.answer(first.time_usec)
        return script(peer)

    background = Background(run)
    link.open(never)
    return background


def flight(link, script, steps):
    """Run a script with a started peer during `steps`. Return the outputs, and the result of the script."""
    background = begin(link, script)
    return fly(link, steps), background.join()


def at_start(peer):
    """Answer up to the first message of the run, which is a full second of PX4's clock; return this message."""
    while True:
        message = peer.receive()
        peer.answer(message.time_usec)
        if message.time_usec % 1_000_000 == 0:
            return message


@pytest.mark.long
def test_every_step_is_answered_with_its_time(link):
    def script(peer):
        first = at_start(peer)
        peer.armed = True
        return first, peer.run(99, lambda message: (0.1, 0.2, 0.3, message.time_usec % 1_000_000 * 1e-6))

    outputs, (first, rest) = flight(link, script, 100)
    times = [message.time_usec - first.time_usec for message in rest]
    assert times == [4000 * k for k in range(1, 100)]
    assert [o.outputs[3] for o in outputs[1:]] == pytest.approx([0.004 * k for k in range(1, 100)])
    assert outputs[5].armed
    assert not outputs[0].armed
    assert (link.report.skew_max, link.report.missed, link.report.late) == (0.0, 0, 0)


def test_free_wheel_shows_vehicle_at_rest(link):
    def run():
        peer = Px4Peer(port_of(link))
        result = [peer.receive() for _ in range(15)]
        peer.answer(result[-1].time_usec)
        at_start(peer)
        return result

    background = Background(run)
    link.open(never)
    fly(link, 1)
    result = background.join()
    assert [b.time_usec - a.time_usec for a, b in itertools.pairwise(result)] == [4000] * 14
    assert all(finite(message) for message in result)
    assert all(message.zacc == pytest.approx(-9.81, abs=0.1) for message in result)
    assert len({message.xacc for message in result}) > 1  # PX4 rejects a sensor with constant values


def test_sensors_have_individual_rates(link):
    background = begin(link, lambda peer: [at_start(peer), *peer.run(49)])
    fly(link, 50)
    masks = [message.fields_updated for message in background.join()]
    assert masks[0] == 0x3F | 0x1C0 | 0x1A00
    assert [k for k, mask in enumerate(masks) if mask & 0x1C0] == list(range(0, 50, 5))
    assert masks[1] == 0x3F


def test_gps_is_sent_at_its_rate(link):
    def run():
        peer = Px4Peer(port_of(link))
        peer.answer(peer.start().time_usec)
        while (message := peer.receive()).time_usec % 1_000_000:
            peer.answer(message.time_usec)
        times, message = [], message
        for _ in range(60):
            for other in peer._waiting:
                if other.get_type() == "HIL_GPS":
                    times.append(other.time_usec % 1_000_000)
            peer.answer(message.time_usec)
            message = peer.receive()
            if message is None:
                break
        return times

    background = Background(run)
    link.open(never)
    fly(link, 60)
    link.close()
    assert background.join() == [0, 100_000, 200_000]


def test_lost_imu_does_not_block(link):
    def script(peer):
        at_start(peer)
        masks = []
        for k in range(1, 31):
            message = peer.receive()
            masks.append(message.fields_updated & 0x3F)
            if not 10 <= k < 20:
                peer.answer(message.time_usec)
        return masks

    background = begin(link, script)
    fly(link, 10)
    fly(link, 10, 10, SAMPLES | {ports.IMU: ImuReading(valid=False)})
    fly(link, 11, 20)
    masks = background.join()
    assert masks[9:19] == [0] * 10
    assert masks[19] == 0x3F
    assert link.report.missed == 0


def test_program_end_during_imu_loss_is_reported(link):
    class Ended:
        pid, repeatable = 1, None

        def check(self, when, starting):
            raise FirmwareError(f"px4: the program ended (signal 9){when}")

        def close(self):
            pass

    def script(peer):
        at_start(peer)
        peer.close()

    flight(link, script, 1)
    link.program = Ended()
    with pytest.raises(FirmwareError, match=r"the program ended \(signal 9\) at t = 0.0\d+ s"):
        fly(link, 20, 1, SAMPLES | {ports.IMU: ImuReading(valid=False)})


def test_missed_answer_is_counted_and_outputs_are_held(link):
    def script(peer):
        at_start(peer)
        peer.armed = True
        peer.run(3, lambda _: (0.5,) * 4)
        peer.receive()  # not answered
        peer.run(3, lambda _: (0.6,) * 4)

    outputs, _ = flight(link, script, 8)
    assert [o.outputs[0] for o in outputs[1:]] == pytest.approx([0.5] * 4 + [0.6] * 3)
    assert link.report.missed == 1


def test_late_answer_is_counted(link):
    def script(peer):
        first = at_start(peer)
        message = peer.receive()
        peer.answer(first.time_usec)
        peer.answer(first.time_usec)
        time.sleep(0.05)
        peer.answer(message.time_usec)

    flight(link, script, 2)
    assert link.report.late >= 1
    assert link.report.missed == 0


def test_stall_is_reported(link):
    link._config = link._config._replace(step_timeout=2.0)
    background = begin(link, lambda peer: (peer, at_start(peer)))  # keep the connection
    with pytest.raises(FirmwareError, match=r"px4: no HIL_ACTUATOR_CONTROLS for 2 s at t = 0.008 s; check"):
        fly(link, 5)
    background.join()


def test_absent_firmware_is_reported(link):
    link._config = link._config._replace(start_timeout=0.5)
    with pytest.raises(FirmwareError, match=r"px4: no connection for 0.5 s at its start; start px4 with"):
        link.open(never)


def test_firmware_without_answers_is_reported(link):
    link._config = link._config._replace(start_timeout=1.0)
    background = Background(lambda: (peer := Px4Peer(port_of(link)), peer.start()))
    with pytest.raises(FirmwareError, match=r"px4: no HIL_ACTUATOR_CONTROLS for 1 s"):
        link.open(never)
    background.join()


@pytest.mark.parametrize("resets", [False, True])
def test_reconnect_keeps_time(link, resets):
    def script(peer):
        first = at_start(peer)
        peer.run(5)
        peer.close(resets)
        other = Px4Peer(port_of(link))
        message = other.start()
        other.answer(message.time_usec)
        return first.time_usec, other.run(10**6)  # messages of the start may still be on their way

    background = begin(link, script)
    fly(link, 10)
    link.close()
    start, messages = background.join()
    assert link.report.reconnected == 1
    assert messages[0].time_usec > start + 6 * 4000
    assert "PX4 closed its connection" in link.report.notes[0]


def test_second_firmware_is_rejected(link):
    def script(peer):
        at_start(peer)
        other = socket.create_connection(("127.0.0.1", port_of(link)))
        peer.run(600)
        other.settimeout(20.0)
        with suppress(ConnectionResetError):
            assert other.recv(1) == b""

    flight(link, script, 601)
    assert "a second PX4" in link.report.notes[0]
    assert link.report.rejected == 1


def test_garbage_is_counted(link):
    def script(peer):
        at_start(peer)
        peer.send_bytes(b"GET / HTTP/1.0\r\n\r\n" + bytes(50))
        peer.run(5)

    flight(link, script, 6)
    assert link.report.rejected >= 1


def test_non_finite_outputs_are_held(link):
    def script(peer):
        at_start(peer)
        peer.armed = True
        peer.run(1, lambda _: (0.5,) * 4)
        peer.run(1, lambda _: (math.nan,) * 4)

    outputs, _ = flight(link, script, 3)
    assert outputs[2].outputs == (0.5,) * 4
    assert "non-finite outputs at t = 0.008 s" in link.report.notes[0]


def test_free_running_firmware_is_reported(link):
    def script(peer):
        message = peer.receive()
        peer.answer(message.time_usec, flags=0)

    with pytest.raises(FirmwareError, match="runs without lock step"):
        begin(link, script)


def test_port_in_use_is_reported(link):
    message = r"cannot listen on tcp 127.0.0.1:.*in use"
    with socket.create_server(("127.0.0.1", port_of(link))), pytest.raises(FirmwareError, match=message):
        link.open(never)


@pytest.mark.parametrize(("charge", "percent"), [(0.42, 42), (math.nan, 100)])
def test_battery_of_plant_is_sent_to_firmware(link, charge, percent):
    samples = {**SAMPLES, ports.BATTERY: BatteryReading(charge, 11.2, 20.0)}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.settimeout(20.0)
        codec = mavlink.MAVLink(None, srcSystem=3, srcComponent=1)

        def script(peer):
            beat = mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3)
            vehicle.sendto(beat.pack(codec), ("127.0.0.1", MAVLINK_PORT + link._config.instance))
            peer.run(10**6)

        background = begin(link, script)
        events = []
        for tick in range(300):
            link.steps.step(tick, **samples)
        link.close()
        background.join()
        vehicle.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                events += codec.parse_buffer(vehicle.recv(4096)) or []
    states = [m for m in events if m.get_type() == "BATTERY_STATUS"]
    assert states
    assert all((m.get_srcSystem(), m.battery_remaining, m.voltages[0]) == (3, percent, 11200) for m in states)
