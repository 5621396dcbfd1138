"""Invalid messages are rejected as the protocol requires, counted, and do not affect the vehicle."""

import random
import socket
import time
from collections import Counter

import pytest
from adapter_harness import Bench, item
from fake_vehicle import flying, free_port, until
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.channel import Channel
from lapwing.services.mavlink.links.link import MAX_RATE, PIECE
from lapwing.services.mavlink.protocols import handlers
from lapwing.services.mavlink.protocols.commands import READ_ONLY, RULES

NAN, INF = float("nan"), float("inf")


@pytest.fixture(scope="module")
def shared():
    return Bench()


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(max_size=600))
def test_random_bytes_are_ignored(shared, data):
    station = shared.station()
    station.raw(data)
    station.raw(b"\xfd" + data)
    shared.adapter.disconnect(station.endpoint)
    shared.stations.clear()
    assert set(shared.vehicle.kinds) <= {"link"}


def frames(bench):
    """Return a valid frame of every message of the dialect, with all fields zero."""
    codec = mavlink.MAVLink(None, 255, 190)
    for cls in mavlink.mavlink_map.values():
        fields = []
        for field, kind in zip(cls.fieldnames, cls.fieldtypes, strict=True):
            length = cls.array_lengths[cls.ordered_fieldnames.index(field)]
            fields.append(b"\0" if kind == "char" else [0] * length if length > 1 else 0)
        yield cls(*fields).pack(codec)


def test_all_messages_zeroed_truncated_and_damaged():
    bench = Bench()
    station = bench.station()
    chance = random.Random(1)
    for frame in frames(bench):
        station.raw(frame)
        station.raw(frame[: chance.randrange(len(frame))])
        damaged = bytearray(frame)
        damaged[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
        station.raw(bytes(damaged))
    bench.step(5)
    assert bench.counts["wrong checksum"] > 50
    assert not bench.vehicle.armed


ODD = {
    "float": [0.0, 1.0, -1.0, NAN, INF, -INF, 1e38, -1e38, 40.7, 400.0],
    "double": [0.0, NAN, INF],
    "int": [0, 1, 2, 3, 16, 255, 2**15, 2**31 - 1, 2**63 - 1, -1, -(2**31)],
}


def test_all_handled_messages_survive_odd_values():
    bench = Bench()
    station = bench.station()
    bench.step(2)
    chance = random.Random(2)
    for _ in range(150):
        for number in handlers():
            station.raw(odd(mavlink.mavlink_map[number], chance).pack(station.codec))
        bench.step()
    assert bench.counts["received"] > 3000


def odd(cls, chance):
    """Return a message for this vehicle with unusual values."""

    def value(kind):
        if kind in ODD:
            return chance.choice(ODD[kind])
        bits, signed = int(kind.removeprefix("u").removeprefix("int").partition("_")[0]), not kind.startswith("u")
        picked = chance.choice(ODD["int"]) & (1 << bits) - 1
        return picked - (1 << bits) if signed and picked >> bits - 1 else picked

    fields = []
    for field, kind in zip(cls.fieldnames, cls.fieldtypes, strict=True):
        length = cls.array_lengths[cls.ordered_fieldnames.index(field)]
        if kind == "char":
            fields.append(chance.choice([b"", b"MPC_XY_P", b"\xff\xfe", b"X" * length]))
        elif field in ("target", "target_system", "target_component"):
            fields.append(chance.choice([0, 1]))
        elif field == "command":
            fields.append(chance.choice(list(RULES)))
        else:
            fields.append([value(kind) for _ in range(length)] if length > 1 else value(kind))
    return cls(*fields)


def test_non_finite_estimate_is_still_reported():
    bench = Bench()
    station = bench.station()
    bench.vehicle.armed, bench.vehicle.mode = True, "offboard"
    for bad in (NAN, INF, 1e30):
        bench.vehicle.setpoint = (bad,) * 11
        bench.vehicle.position, bench.vehicle.yaw = [bad] * 3, NAN
        bench.step(60)
    assert station.last("HEARTBEAT")


def test_wrong_checksum_affects_only_one_frame():
    bench = Bench()
    station = bench.station()
    good = mavlink.MAVLink_param_request_read_message(1, 1, b"MPC_XY_P", -1).pack(station.codec)
    bad = good[:-1] + bytes([good[-1] ^ 1])
    station.raw(bad + good)
    assert station.last("PARAM_VALUE").param_id == "MPC_XY_P"
    assert bench.counts["wrong checksum"] == 1


def test_commands_for_other_systems_are_ignored():
    bench = Bench()
    station = bench.station()
    for system, component in ((2, 1), (1, 100)):
        station.send("command_long", system, component, 400, 0, 1.0, *(0.0,) * 6)
    bench.step(3)
    assert not bench.vehicle.armed
    assert station.last("COMMAND_ACK") is None
    assert bench.counts["for another vehicle"] == 2


@pytest.mark.parametrize("count", [1001, 10_000, 65_535])  # -1 is 65 535 on the wire
def test_mission_with_too_many_items_is_rejected(count):
    bench = Bench()
    station = bench.station()
    station.send("mission_count", 1, 1, count, 0)
    assert station.last("MISSION_ACK").type == mavlink.MAV_MISSION_NO_SPACE
    assert station.last("MISSION_REQUEST_INT") is None


def test_unknown_mission_kind_is_rejected():
    bench = Bench()
    station = bench.station()
    station.send("mission_count", 1, 1, 3, 77)
    assert station.last("MISSION_ACK").type == mavlink.MAV_MISSION_UNSUPPORTED
    station.send("mission_item_int", *item(0, kind=77))
    station.send("mission_request_int", 1, 1, 5, 0)
    assert station.last("MISSION_ACK").type == mavlink.MAV_MISSION_INVALID_SEQUENCE


@pytest.mark.parametrize(
    ("number", "params", "result"),
    [
        (400, (NAN,), mavlink.MAV_RESULT_DENIED),
        (400, (7.0,), mavlink.MAV_RESULT_DENIED),
        (22, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, INF), mavlink.MAV_RESULT_DENIED),
        (192, (-1.0, 0.0, 0.0, NAN, 1e9, 0.0, 10.0), mavlink.MAV_RESULT_DENIED),
        (176, (NAN, 4.0, 3.0), mavlink.MAV_RESULT_DENIED),
        (176, (1.0, 99.0, 0.0), mavlink.MAV_RESULT_UNSUPPORTED),
        (511, (NAN, 1e5), mavlink.MAV_RESULT_DENIED),
        (511, (99_999.0, 1e5), mavlink.MAV_RESULT_UNSUPPORTED),
        (511, (30.0, NAN), mavlink.MAV_RESULT_UNSUPPORTED),
        (511, (30.0, INF), mavlink.MAV_RESULT_DENIED),
        (510, (-1.0,), mavlink.MAV_RESULT_DENIED),
        (512, (INF,), mavlink.MAV_RESULT_DENIED),
        (224, (1e30,), mavlink.MAV_RESULT_DENIED),
        (60_000, (), mavlink.MAV_RESULT_UNSUPPORTED),
        (203, (), mavlink.MAV_RESULT_UNSUPPORTED),
    ],
)
def test_invalid_commands_are_acknowledged(number, params, result):
    station = Bench().station()
    assert station.command(number, *params) == result
    by_autopilot = number == mavlink.MAV_CMD_DO_SET_MISSION_CURRENT  # which sends its own text
    denied = result == mavlink.MAV_RESULT_DENIED and number not in READ_ONLY and not by_autopilot
    texts = [m.text for m in station.all("STATUSTEXT")]
    assert any("denied, invalid parameters" in text for text in texts) == denied, texts


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 1e38])
def test_invalid_setpoints_do_not_move_vehicle(bad):
    bench = Bench()
    station = bench.station()
    bench.vehicle.armed = True
    station.send("set_attitude_target", 0, 1, 1, 0, [bad] * 4, bad, bad, bad, bad)
    station.send("set_position_target_local_ned", 0, 1, 1, 99, 0, *(bad,) * 11)
    station.send("set_position_target_global_int", 0, 1, 1, 6, 0, 2**31 - 1, -(2**31), *(bad,) * 9)
    bench.step(5)
    assert bench.vehicle.position == [0.0, 0.0, 0.0]


def test_short_interval_does_not_flood_client():
    bench = Bench()
    station = bench.station()
    assert station.command(511, 30.0, 1.0) == mavlink.MAV_RESULT_ACCEPTED  # ATTITUDE each microsecond
    station.got.clear()
    bench.step(50)
    assert len(station.all("ATTITUDE")) == 50


def test_too_long_interval_is_clamped():
    bench = Bench()
    station = bench.station()
    assert station.command(511, 30.0, 1e38) == mavlink.MAV_RESULT_ACCEPTED
    station.command(510, 30.0)
    assert station.last("MESSAGE_INTERVAL").interval_us == 0x7FFFFFFF


def test_flood_is_limited_and_flight_continues():
    port = free_port()
    frame = mavlink.MAVLink_command_long_message(1, 1, 60_000, 0, *(0.0,) * 7).pack(mavlink.MAVLink(None, 255, 190))
    began = time.monotonic()
    with flying(f"udpin:127.0.0.1:{port}") as running, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        attacker.connect(("127.0.0.1", port))
        before, end = running.vehicle.time_ns, time.monotonic() + 1.5
        while time.monotonic() < end:
            for _ in range(50):
                attacker.send(frame)
        assert until(lambda: running.vehicle.time_ns > before + 2e8)
        received = running.counts["received"]  # before the time: a busy machine reads fewer than the limit
        assert received <= MAX_RATE * (1.0 + time.monotonic() - began)


def test_number_of_endpoints_is_limited():
    port = free_port()
    with flying(f"udpin:127.0.0.1:{port}") as running:
        sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(12)]
        for k, s in enumerate(sockets):
            heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mavlink.MAVLink(None, 200 + k, 1))
            s.sendto(b"nonsense", ("127.0.0.1", port))
            s.sendto(heartbeat, ("127.0.0.1", port))
        assert until(lambda: running.counts["too many endpoints"] >= 4)
        assert len(running.hub.adapter.sessions) == 8
        for s in sockets:
            s.close()


@pytest.mark.parametrize("seed", range(8))
def test_first_command_after_garbage_is_answered(seed):
    """Without resynchronisation a marker in the garbage swallows up to 280 bytes of the commands behind it."""
    counts, codec = Counter(), mavlink.MAVLink(None, 255, 190)
    channel = Channel((1, 1), None, False, counts, strict=True)
    heartbeat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(codec)
    assert len(list(channel.decode(heartbeat))) == 1
    garbage = random.Random(seed).randbytes(23_000)
    for begin in range(0, len(garbage), PIECE):
        assert not list(channel.decode(garbage[begin : begin + PIECE]))
    for _ in range(3):
        frame = mavlink.MAVLink_param_request_read_message(1, 1, b"MPC_XY_P", -1).pack(codec)
        got = [m for part in (frame[:7], frame[7:]) for m in channel.decode(part)]
        assert [m.get_type() for m in got] == ["PARAM_REQUEST_READ"]
    assert counts["not MAVLink"]


def test_frames_after_false_marker_are_read():
    codec = mavlink.MAVLink(None, 255, 190)
    channel = Channel((1, 1), None, False, Counter())
    frame = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(codec)
    unknown = b"\xfd\x40\0\0\0\0\0\xff\xff\xff"
    for false_start in (b"\xfe\x09\0\0\0\0", b"\xfd\x40\0\0\0\0\0\0\0\0", unknown, b"\xfd\xfe\xfd"):
        assert len(list(channel.decode(frame + false_start + 10 * frame))) == 11
