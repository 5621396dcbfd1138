"""Link before the first message of the vehicle: it reports the start and serves static data."""

from adapter_harness import Bench

from lapwing.services.common.mavlink.dialect import mavlink


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
