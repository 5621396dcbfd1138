"""Link before the first message, and its address, which changes at a reboot."""

import math

import pytest
from adapter_harness import Bench
from test_parameters import integer, read, set_whole

from lapwing.services.common.mavlink.dialect import mavlink


def present_address(station):
    return {(m.get_srcSystem(), m.get_srcComponent()) for m in station.got}


def test_address_changes_at_reboot():
    bench = Bench()
    station, other = bench.station(), bench.station(system=254)
    set_whole(bench, station, "MAV_SYS_ID", 42)
    set_whole(bench, station, "MAV_COMP_ID", 7)
    bench.step(60)
    assert integer(read(station, "MAV_SYS_ID")) == 42
    assert present_address(station) == {(1, 1)}
    assert station.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0) == mavlink.MAV_RESULT_ACCEPTED
    bench.step(2)
    for each in (station, other):
        each.got.clear()
    bench.step(120)
    for each in (station, other):
        assert present_address(each) == {(42, 7)}
        assert each.last("HEARTBEAT")
    assert bench.station().endpoint.send(mavlink.MAVLink_ping_message(0, 0, 0, 0)) is None
    assert present_address(bench.stations[-1]) == {(42, 7)}  # also of a later connection
    station.got.clear()
    station.send("param_request_read", 1, 1, b"MAV_SYS_ID", -1)
    assert station.got == []
    station.send("param_request_read", 42, 7, b"MAV_SYS_ID", -1)
    assert integer(station.last("PARAM_VALUE")) == 42


@pytest.mark.parametrize(
    ("action", "armed", "result"),
    [
        (0.0, True, mavlink.MAV_RESULT_ACCEPTED),  # nothing to do
        (1.0, True, mavlink.MAV_RESULT_DENIED),
        (2.0, False, mavlink.MAV_RESULT_DENIED),  # shutdown
        (math.nan, False, mavlink.MAV_RESULT_DENIED),
    ],
)
def test_reboot_only_while_disarmed(action, armed, result):
    bench = Bench()
    station = bench.station()
    bench.vehicle.armed = armed
    set_whole(bench, station, "MAV_SYS_ID", 42)
    bench.step(2)
    assert station.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, action) == result
    texts = [m.text for m in station.all("STATUSTEXT")]
    assert ("Reboot denied: disarm first" in texts) == (armed and action == 1.0)
    station.got.clear()
    bench.step(120)
    assert present_address(station) == {(1, 1)}


@pytest.mark.parametrize("value", [0, 251, -1, 2**31 - 1])
@pytest.mark.parametrize("name", ["MAV_SYS_ID", "MAV_COMP_ID"])
def test_address_out_of_range_is_rejected(name, value):
    bench = Bench()
    station = bench.station()
    set_whole(bench, station, name, value)
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert integer(station.last("PARAM_VALUE")) == 1


def test_vehicle_type_is_shown_in_heartbeat():
    bench = Bench()
    station = bench.station()
    set_whole(bench, station, "MAV_TYPE", mavlink.MAV_TYPE_OCTOROTOR)
    bench.step(60)
    assert station.last("HEARTBEAT").type == mavlink.MAV_TYPE_OCTOROTOR
    set_whole(bench, station, "MAV_TYPE", mavlink.MAV_TYPE_FIXED_WING)
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE


def test_heartbeat_reports_start_until_first_message():
    bench = Bench(starting=True)
    station = bench.station()
    for k in range(25):
        bench.adapter.tick(100.0 + 0.1 * k)
    beats = station.all("HEARTBEAT")
    assert [m.system_status for m in beats] == [mavlink.MAV_STATE_BOOT] * 3
    station.got.clear()
    bench.step(3)
    assert station.last("HEARTBEAT").system_status == mavlink.MAV_STATE_STANDBY
    station.got.clear()
    bench.adapter.tick(200.0)
    assert not station.got


def test_parameters_and_identity_are_sent_during_start():
    bench = Bench(starting=True)
    station = bench.station()
    station.send("param_request_list", 1, 1)
    for k in range(20):
        bench.adapter.tick(0.01 * k)
    assert len({v.param_id for v in station.all("PARAM_VALUE")}) == len(bench.adapter.parameters.names)
    station.send("command_long", 1, 1, 512, 0, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, *[0.0] * 6)
    assert station.last("AUTOPILOT_VERSION")


def test_commands_are_temporarily_rejected():
    bench = Bench(starting=True)
    station = bench.station()
    station.send("command_long", 1, 1, 400, 0, 1.0, *[0.0] * 6)
    assert station.last("COMMAND_ACK").result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    bench.step()
    assert station.command(400, 1.0) == mavlink.MAV_RESULT_ACCEPTED


def test_autopilot_gets_parameter_that_was_set_before_its_start():
    """PX4's parameters can be set from its first heartbeat; its client tests do so."""
    bench = Bench(starting=True)
    station = bench.station()
    station.send("param_set", 1, 1, b"MIS_TAKEOFF_ALT", 7.5, mavlink.MAV_PARAM_TYPE_REAL32)
    assert station.last("PARAM_VALUE").param_value == 7.5
    assert station.last("PARAM_ERROR") is None
    assert "parameter" not in bench.vehicle.kinds
    bench.step(2)
    assert bench.vehicle.parameters["MIS_TAKEOFF_ALT"] == 7.5


def test_invalid_parameter_is_rejected_during_start():
    bench = Bench(starting=True)
    station = bench.station()
    station.send("param_set", 1, 1, b"MIS_TAKEOFF_ALT", 1e6, mavlink.MAV_PARAM_TYPE_REAL32)
    assert station.last("PARAM_ERROR")
    assert station.last("PARAM_VALUE").param_value < 1e6
    bench.step(2)
    assert "parameter" not in bench.vehicle.kinds
