"""Commands: requests to the autopilot, and acknowledgements to the client."""

import math

import pytest
from adapter_harness import Bench

from lapwing.messages import CommandAck
from lapwing.services.common.failure_types import KINDS, UNITS
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.firmware import ardupilot, px4

NAN = math.nan
RESTING_HEIGHT = 0.35  # [m] height of the delivery drone's body origin above the ground


def requested_values(bench, kind):
    bench.step(2)
    return bench.vehicle.kinds[kind].values


def test_takeoff_altitude_above_sea_converts_to_home():
    bench = Bench()
    bench.vehicle.armed = True
    assert bench.station().command(22, 0.0, 0.0, 0.0, NAN, NAN, NAN, 292.0) == mavlink.MAV_RESULT_ACCEPTED
    assert requested_values(bench, "takeoff")[0] == pytest.approx(12.0)  # the world's origin lies at 280 m


def test_takeoff_without_height_climbs_by_parameter():
    bench = Bench()
    bench.vehicle.armed = True
    bench.station().command(22, NAN, NAN, NAN, NAN, NAN, NAN, NAN)
    assert requested_values(bench, "takeoff")[0] == pytest.approx(2.5 + RESTING_HEIGHT)


def test_ardupilot_takeoff_altitude_is_above_home():
    bench = Bench("mavlink.firmware=ardupilot")
    bench.vehicle.armed = True
    bench.station().command(22, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 12.0)
    assert requested_values(bench, "takeoff")[0] == pytest.approx(12.0 + RESTING_HEIGHT)


def test_reposition_keeps_unspecified_values():
    bench = Bench()
    bench.vehicle.armed, bench.vehicle.position = True, [3.0, 4.0, 5.0]
    bench.step()
    station = bench.station()
    station.command(192, -1.0, 1.0, 0.0, NAN, NAN, NAN, 290.0)
    x, y, z, yaw, speed = requested_values(bench, "goto")
    assert (x, y, z) == pytest.approx((3.0, 4.0, 10.0))
    assert math.isnan(yaw)
    assert math.isnan(speed)
    station.command(192, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN)
    assert bench.vehicle.mode == "hold"


@pytest.mark.parametrize("number", [21, 20, 17])
def test_autopilot_rejection_is_acknowledged(number):
    bench = Bench()
    bench.vehicle.do_return = bench.vehicle.enter
    assert bench.station().command(number) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_progress_is_forwarded_before_result():
    bench = Bench()
    results = iter([CommandAck(result=CommandAck.IN_PROGRESS, progress=0.4)])
    bench.vehicle.unanswered = {"link"}
    bench.vehicle.handle = lambda c: next(results)._replace(id=c.id, source=c.source)
    station = bench.station()
    station.send("command_long", 1, 1, 300, 0, *(0.0,) * 7)
    bench.step(2)
    ack = station.last("COMMAND_ACK")
    assert (ack.result, ack.progress) == (mavlink.MAV_RESULT_IN_PROGRESS, 40)
    number = bench.vehicle.kinds["mission_start"].id
    bench.vehicle.answers = [CommandAck("255/190", number, CommandAck.ACCEPTED)]
    bench.step()
    assert station.last("COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED


def test_command_without_acknowledgement_is_rejected():
    bench = Bench()
    bench.vehicle.unanswered = {"arm"}
    station = bench.station()
    assert station.command(400, 1.0, seconds=1.5) is None
    bench.step(50)
    assert station.last("COMMAND_ACK").result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def test_recorded_flight_rejects_commands():
    bench = Bench(recorded=True)
    assert bench.station().command(400, 1.0) == mavlink.MAV_RESULT_TEMPORARILY_REJECTED


@pytest.mark.parametrize("firmware", [px4, ardupilot])
def test_every_listed_mode_can_be_entered(firmware):
    for mode in ("hold", "mission", "return", "land", "position_control", "stabilized", "acro", "altitude_control"):
        assert firmware.mode_kind(firmware.mode_number(mode)) == mode


def test_px4_mode_numbers():
    assert px4.mode_number("offboard") == 6 << 16
    assert px4.mode_number("return") == 4 << 16 | 5 << 24
    assert px4.mode_kind(px4.custom_mode(4.0, 6.0)) == "land"
    assert px4.mode_kind(1 << 16) == "stabilized"  # a multirotor's manual
    assert px4.mode_kind(9 << 16) is None


@pytest.mark.parametrize(("number", "params"), [(176, (1.0, 77.0, 3.0)), (176, (4.0,)), (178, (3.0, 5.0))])
def test_unknown_command_is_rejected_with_text(number, params):
    bench = Bench()
    station = bench.station()
    assert station.command(number, *params) == mavlink.MAV_RESULT_UNSUPPORTED
    assert station.last("STATUSTEXT")
    other = Bench().station()
    other.send("set_mode", 1, 1, 77 << 16)
    other.bench.step()
    assert other.last("STATUSTEXT").text == f"no flight mode {77 << 16}"


def test_heading_without_position_turns_in_place():
    bench = Bench()
    bench.vehicle.armed = True
    bench.step()
    station = bench.station()
    station.command(192, -1.0, 1.0, 0.0, 0.5 * math.pi, NAN, NAN, NAN)
    assert requested_values(bench, "hold") == pytest.approx((0.0,), abs=1e-6)  # east
    station.command(115, 30.0, 10.0, -1.0, 1.0)
    bench.step()
    assert requested_values(bench, "hold") == pytest.approx((math.radians(30.0),), abs=1e-6)  # to the left of east
    station.command(186, 12.0, 3.0)
    assert requested_values(bench, "goto")[2] == pytest.approx(12.0 + 0.35)


def test_home_region_of_interest_and_orbit():
    bench = Bench()
    bench.vehicle.do_set_home = bench.vehicle.do_roi = lambda c: 0
    bench.vehicle.armed = True
    bench.step()
    station = bench.station()
    there = 40.7686 + 10.0 / 111_049, 14.7907
    station.command(179, 0.0, 0.0, 0.0, 0.0, *there, 290.0)
    assert requested_values(bench, "set_home") == pytest.approx((0.0, 10.0, 9.65), abs=0.3)
    station.command(179, 1.0)
    assert requested_values(bench, "set_home") == ()
    station.command(195, 0.0, 0.0, 0.0, 0.0, *there, 280.0)
    assert requested_values(bench, "roi") == pytest.approx((0.0, 10.0, 0.0), abs=0.3)
    station.command(197)
    assert requested_values(bench, "roi") == ()
    station.command(34, 12.0, 3.0, 0.0, NAN, *there, 290.0)
    values = requested_values(bench, "orbit")
    assert values[:6] == pytest.approx((0.0, 10.0, 10.0, 12.0, -3.0, 0.0), abs=0.3)  # clockwise
    station.command(34, -12.0, NAN, NAN, NAN, NAN, NAN, NAN)
    assert requested_values(bench, "orbit")[3:5] == pytest.approx((12.0, 1.0))


def test_position_in_ardupilot_form_is_accepted():
    bench = Bench("mavlink.firmware=ardupilot")
    bench.vehicle.armed = True
    bench.step()
    station = bench.station()
    place = round((40.7686 + 10.0 / 111_049) * 1e7), 147907000, 20.0
    station.send("mission_item_int", 1, 1, 0, 6, 16, 2, 0, 0.0, 0.0, 0.0, 0.0, *place, 0)
    assert requested_values(bench, "goto") == pytest.approx((0.0, 10.0, 20.35), abs=0.05)
    bench.step()
    assert station.last("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED


LOCAL, GLOBAL = "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT"


def position_target(station, name, frame, mask):
    place = (3.0, 2.0) if name == LOCAL else (407686000, 147907000)
    station.send(name.lower(), 0, 1, 1, frame, mask, *place, -4.0, 1.0, 0.5, -0.5, 0.1, 0.2, 0.3, 0.4, 0.1)


@pytest.mark.parametrize("name", [LOCAL, GLOBAL])
@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
def test_every_setpoint_is_followed_or_rejected_with_text(name, firmware):
    bench = Bench(f"mavlink.firmware={firmware}")
    bench.vehicle.armed, bench.vehicle.landed = True, False
    bench.step()
    station, kinds = bench.station(), bench.vehicle.kinds
    legal = (1, 7, 8, 9, 12) if name == LOCAL else (0, 3, 5, 6)
    for frame in (*legal, 2, 10, 11, 99):
        for mask in [*range(0, 4096, 7), 4095 & ~512]:
            kinds.clear()
            station.got.clear()
            station.bench.adapter.sessions[station.endpoint]._sent_texts.clear()
            position_target(station, name, frame, mask)
            bench.vehicle.mode, bench.vehicle.position = "hold", [0.0, 0.0, 3.0]
            bench.step()
            is_rejected = frame not in legal or bool(mask & 512) or (mask | 512) == 4095
            assert bool(set(kinds) - {"link"}) != is_rejected, (frame, mask)
            assert bool(station.last("STATUSTEXT")) == is_rejected
            if is_rejected:
                assert name in "".join(m.text for m in station.all("STATUSTEXT"))


def test_ardupilot_guided_follows_setpoints_and_keeps_position():
    bench = Bench("mavlink.firmware=ardupilot")
    bench.step()
    station = bench.station()
    position_target(station, LOCAL, 1, 0xDF8)
    bench.step()
    assert "only in GUIDED" in "".join(m.text for m in station.all("STATUSTEXT"))
    bench.vehicle.armed, bench.vehicle.landed = True, False
    bench.step()
    position_target(station, LOCAL, 1, 0xDF8)
    assert requested_values(bench, "goto")[:3] == pytest.approx((2.0, 3.0, 4.0 + RESTING_HEIGHT))
    bench.vehicle.mode = "hold"
    bench.step()
    position_target(station, LOCAL, 1, 0xDC7)
    bench.step()
    assert bench.vehicle.mode == "offboard"
    station.send("set_attitude_target", 0, 1, 1, 0b111, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0, 1.0)
    values = requested_values(bench, "offboard_attitude")
    assert math.isnan(values[7])
    assert math.isnan(values[8]) or values[8] > 0.0  # the thrust is a climb rate


def test_body_rates_and_thrusts_of_either_kind():
    bench = Bench()
    station = bench.station()
    level = [1.0, 0.0, 0.0, 0.0]
    station.send("set_attitude_target", 0, 1, 1, 0b1000_0000, level, 0.1, 0.2, 0.3, 0.6)
    values = requested_values(bench, "offboard_attitude")
    assert math.isnan(values[0])
    assert values[4:8] == pytest.approx((0.1, -0.2, -0.3, 0.6))
    station.send("set_attitude_target", 0, 1, 1, 0b0010_0111, level, 0.0, 0.0, 0.0, 0.0)
    station.send("set_attitude_target", 0, 1, 1, 0b1000_0111, level, 0.0, 0.0, 0.0, 0.5)
    bench.step()
    assert [m.text for m in station.all("STATUSTEXT")] == [
        "SET_ATTITUDE_TARGET: thrust_body unsupported", "SET_ATTITUDE_TARGET: contains no setpoint",
    ]  # fmt: skip


def test_velocities_in_body_axes_are_rotated():
    bench = Bench()
    bench.vehicle.yaw = 0.5 * math.pi  # north
    bench.step()
    station = bench.station()
    mask = 0b0000_1101_1100_0111  # velocities only
    station.send("set_position_target_local_ned", 0, 1, 1, 8, mask, 0, 0, 0, 2.0, 1.0, -0.5, 0, 0, 0, 0, 0)
    values = requested_values(bench, "offboard_position")
    assert values[3:6] == pytest.approx((1.0, 2.0, 0.5))  # forward is north, right is east
    assert all(map(math.isnan, (*values[:3], *values[6:])))


def test_offsets_are_relative_to_vehicle():
    bench = Bench()
    bench.vehicle.position, bench.vehicle.yaw = [1.0, 2.0, 3.0], 0.0  # east
    bench.step()
    station = bench.station()
    mask = 0b0000_1101_1111_1000
    station.send("set_position_target_local_ned", 0, 1, 1, 12, mask, 5.0, 0, -1.0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert requested_values(bench, "offboard_position")[:3] == pytest.approx((6.0, 2.0, 4.0))


def test_sticks_have_signs_of_axes():
    bench = Bench()
    bench.station().send("manual_control", 1, 500, 1000, 750, -1000, 0)
    assert requested_values(bench, "manual") == pytest.approx((0.5, -1.0, 0.5, 1.0))


def test_heartbeat_keeps_link_until_timeout():
    bench = Bench()
    station = bench.station()
    station.send("heartbeat", 6, 8, 0, 0, 0, 3)
    links = []
    bench.vehicle.do_link = lambda c: links.append(bench.vehicle.seconds)
    bench.step(500)
    assert len(links) == 4
    assert links[-1] < 4.0


def test_failure_injection_uses_mavlink_numbers():
    bench = Bench()
    bench.vehicle.do_inject_failure = lambda c: 0
    station = bench.station()
    for name, number in mavlink.enums["FAILURE_TYPE"].items():
        if number.name != "FAILURE_TYPE_ENUM_END":
            kind = KINDS[name]
            assert number.name == f"FAILURE_TYPE_{'OK' if kind == 'sound' else kind.upper()}"
            assert station.command(420, mavlink.FAILURE_UNIT_SENSOR_BARO, name, 0.0, 0.0) == mavlink.MAV_RESULT_ACCEPTED
            assert requested_values(bench, "inject_failure") == (UNITS.index("barometer"), name, 0.0, 0.0)
    for unit, name in (
        (mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR, "distance_sensor"),
        (mavlink.FAILURE_UNIT_SENSOR_OPTICAL_FLOW, "optical_flow"),
        (mavlink.FAILURE_UNIT_SENSOR_AIRSPEED, "airspeed"),
    ):
        assert station.command(420, unit, 1.0, 0.0) == mavlink.MAV_RESULT_ACCEPTED
        assert requested_values(bench, "inject_failure") == (UNITS.index(name), 1.0, 0.0, 0.0)
    assert station.command(420, mavlink.FAILURE_UNIT_SENSOR_VIO, 1.0, 0.0) == mavlink.MAV_RESULT_UNSUPPORTED
    for unit, kinds, words in (
        (mavlink.FAILURE_UNIT_SYSTEM_MOTOR, (0, 1, 2, 4, 5), "motor can be sound, off, stuck, wrong, slow"),
        (mavlink.FAILURE_UNIT_SYSTEM_BATTERY, (0, 1, 2, 4), "battery can be sound, off, stuck, wrong"),
    ):
        for kind in range(8):
            expected = mavlink.MAV_RESULT_ACCEPTED if kind in kinds else mavlink.MAV_RESULT_UNSUPPORTED
            assert station.command(420, unit, kind, 1.0) == expected
        reported = "".join(m.text for m in station.all("STATUSTEXT"))
        assert f"INJECT_FAILURE: type 7 unsupported; {words}" in reported
    assert station.command(420, mavlink.FAILURE_UNIT_SENSOR_BARO, 8.0, 0.0) == mavlink.MAV_RESULT_UNSUPPORTED
