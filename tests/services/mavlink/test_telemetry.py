"""Telemetry: units, frames and rates against the published messages."""

import math

import pytest
from adapter_harness import Bench

from lapwing.messages import BatteryState, Vector3, VehicleState
from lapwing.messages.topics import BATTERY, TRUTH
from lapwing.services.common.mavlink.dialect import mavlink


def shown(bench, kind, steps=60):
    station = bench.station()
    bench.step(steps)
    return station.last(kind)


def moved():
    bench = Bench()
    bench.vehicle.position, bench.vehicle.yaw = [30.0, 40.0, 12.0], math.radians(30.0)
    return bench


def test_position_on_earth():
    m = shown(moved(), "GLOBAL_POSITION_INT")
    assert (m.lat - 407686000) * 1e-7 * 111_049 == pytest.approx(40.0, rel=2e-3)  # metres per degree at home
    assert (m.lon - 147907000) * 1e-7 * 84_418 == pytest.approx(30.0, rel=2e-3)
    assert (m.alt, m.relative_alt) == (292_000, 11_650)  # the body origin at rest is 0.35 m above the ground
    assert m.hdg == 6000  # 30 degrees north of east


def test_local_position_is_north_east_down():
    m = shown(moved(), "LOCAL_POSITION_NED")
    assert (m.x, m.y, m.z) == pytest.approx((40.0, 30.0, 0.35 - 12.0))  # from the start position


def test_stream_rates_have_defaults_and_can_be_changed():
    bench = Bench()
    ground, onboard = bench.station(), bench.station(system=2)
    onboard.send("heartbeat", mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 8, 0, 0, 0, 3)
    ground.send("command_long", 1, 1, 511, 0, 30.0, 100_000.0, *(0.0,) * 5)
    bench.step(500)
    counts = {kind: (len(ground.all(kind)), len(onboard.all(kind))) for kind in ("SYS_STATUS", "ATTITUDE", "HEARTBEAT")}
    assert counts["SYS_STATUS"] == (11, 51)  # at 0 s and at 10 s too
    assert counts["ATTITUDE"][0] == pytest.approx(100, abs=2)
    assert counts["ATTITUDE"][1] == 500
    assert counts["HEARTBEAT"] == (12, 12)  # one of them at the first status


def test_mode_change_is_announced():
    bench = Bench()
    station = bench.station()
    bench.step(60)
    station.got.clear()
    bench.vehicle.armed = True
    bench.step(2)
    assert station.last("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def test_arming_blockers_are_sent_and_long_texts_split():
    bench = Bench()
    station = bench.station()
    bench.vehicle.arming_blockers = ("no GPS fix",)
    bench.vehicle.text = ["x" * 60 + "y" * 60]
    bench.step(60)
    assert not station.last("SYS_STATUS").onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK
    pieces = station.all("STATUSTEXT")
    assert [m.chunk_seq for m in pieces] == [0, 1, 2]
    assert "".join(m.text for m in pieces) == "x" * 60 + "y" * 60
    assert len({m.id for m in pieces}) == 1


def test_odometry_in_free_fall_is_along_body_axes():
    bench = Bench()
    half = 0.5 * math.radians(90.0)
    truth = VehicleState(acceleration=Vector3(0.0, 9.80665, 0.0))
    q = truth.pose.orientation._replace(w=math.cos(half), z=math.sin(half))  # the nose points north
    truth = truth._replace(pose=truth.pose._replace(orientation=q))
    bench.adapter.handle(TRUTH, 0, truth.encode(), 0.0)
    m = shown(bench, "HIL_STATE_QUATERNION")
    assert (m.xacc, m.yacc, m.zacc) == (1000, 0, 0)


def test_progress_of_mission():
    bench = Bench()
    bench.vehicle.items, bench.vehicle.current, bench.vehicle.reached, bench.vehicle.state = (), 1, 0, 3
    station = bench.station()
    bench.step(60)
    assert station.last("MISSION_CURRENT").seq == 1
    assert station.last("MISSION_ITEM_REACHED") is None  # there is no mission


def test_origin_is_echoed_exactly():
    bench = Bench()
    station = bench.station()
    station.send("set_gps_global_origin", 1, 473977418, 85455939, 488123)
    m = station.last("GPS_GLOBAL_ORIGIN")
    assert (m.latitude, m.longitude, m.altitude) == (473977418, 85455939, 488123)


def test_clocks_are_compared():
    bench = Bench()
    station = bench.station()
    bench.step(10)
    station.send("timesync", 0, 12345)
    answers = [m for m in station.all("TIMESYNC") if m.tc1]
    assert (answers[0].tc1, answers[0].ts1) == (bench.vehicle.time_ns, 12345)
    station.send("ping", 7, 3, 0, 0)
    m = station.last("PING")
    assert (m.time_usec, m.seq, m.target_system, m.target_component) == (7, 3, 255, 190)


def test_request_of_missing_message_is_rejected():
    bench = Bench()
    station = bench.station()
    station.send("log_request_list", 1, 1, 0, 0xFFFF)
    assert station.last("LOG_ENTRY").num_logs == 0
    station.send("log_request_data", 1, 1, 1, 0, 90)
    bench.step()
    assert station.last("LOG_DATA").count == 0
    station.send("log_erase", 1, 1)
    assert "LOG_ERASE" in station.last("STATUSTEXT").text


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_growing_log_is_downloaded(tmp_path, loss):
    path = tmp_path / "flight.mcap"
    path.write_bytes(bytes(range(256)) * 99)
    bench = Bench(log=path)
    station = bench.station(loss=loss)
    while station.last("LOG_ENTRY") is None:
        station.send("log_request_list", 1, 1, 0, 0xFFFF)
        bench.step()
    entry = station.last("LOG_ENTRY")
    assert (entry.num_logs, entry.size) == (1, 256 * 99)
    path.write_bytes(path.read_bytes() + b"more")
    actual = bytearray(entry.size)
    missing = set(range(0, entry.size, 90))
    for _ in range(60):
        station.got.clear()
        first = min(missing)
        station.send("log_request_data", 1, 1, entry.id, first, entry.size - first)
        bench.step(6)
        for m in station.all("LOG_DATA"):
            actual[m.ofs : m.ofs + m.count] = bytes(m.data[: m.count])
            missing.discard(m.ofs)
        if not missing:
            break
    assert actual == path.read_bytes()[: entry.size]


def test_battery_status_has_cells_and_charge_state():
    bench = Bench()
    battery = BatteryState(
        voltage=42.0, current=-20.0, charge=1.2, design_capacity=10.0, percentage=0.12, cell_voltage=(3.5,) * 12
    )
    bench.vehicle.more = [(BATTERY, battery)]
    bench.vehicle.status = {"battery_warning": 1}
    station = bench.station()
    bench.step(120)
    m = station.last("BATTERY_STATUS")
    assert sum([*m.voltages, *m.voltages_ext]) == 42_000  # as ground stations add them
    assert (m.current_battery, m.current_consumed, m.battery_remaining) == (2000, 8800, 12)
    assert m.charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    s = station.last("SYS_STATUS")
    assert (s.voltage_battery, s.current_battery, s.battery_remaining) == (42_000, 2000, 12)
    assert s.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    bench.vehicle.status = {"battery_warning": 3, "failed_motor": 2}
    bench.step(60)
    health = station.last("SYS_STATUS").onboard_control_sensors_health
    assert not health & (mavlink.MAV_SYS_STATUS_SENSOR_BATTERY | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS)


def test_home_is_arming_position_and_announced():
    bench = Bench()
    station = bench.station()
    bench.step(5)
    station.got.clear()
    bench.vehicle.status = {"home": Vector3(30.0, 40.0, 0.0)}
    bench.step(1)
    m = station.last("HOME_POSITION")
    assert (m.x, m.y, m.z) == pytest.approx((40.0, 30.0, 0.0))
    assert (m.latitude - 407686000) * 1e-7 * 111_049 == pytest.approx(40.0, rel=2e-3)
    assert m.altitude == 280_350


def test_take_off_to_ten_metres_above_home_climbs_ten():
    bench = Bench()
    bench.vehicle.position = [0.0, 0.0, 0.35]
    station = bench.station()
    bench.step(60)
    home, m = station.last("HOME_POSITION"), station.last("GLOBAL_POSITION_INT")
    assert m.relative_alt == 0
    assert m.alt == pytest.approx(home.altitude, abs=1)
    assert station.last("ALTITUDE").altitude_relative == pytest.approx(0.0, abs=1e-6)
    bench.vehicle.armed = True
    station.command(
        22, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan, 1e-3 * home.altitude + 10.0
    )  # as QGroundControl does
    bench.step(300)
    assert station.last("GLOBAL_POSITION_INT").relative_alt == pytest.approx(10_000, abs=300)
    assert bench.vehicle.target[2] == pytest.approx(10.35, abs=1e-3)


def test_home_keeps_heading_at_arming():
    bench = Bench()
    station = bench.station()
    bench.vehicle.yaw = 0.0  # east
    bench.step(5)
    bench.vehicle.armed, bench.vehicle.yaw = True, 1.0
    bench.step(200)
    assert station.last("HOME_POSITION").q == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
