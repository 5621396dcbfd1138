"""Parameters of the autopilot and facts for PX4's ground stations; changes are sent to every station."""

import math
import struct

import pytest
from adapter_harness import Bench
from fake_vehicle import PARAMETERS

from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.px4_facts import px4_facts
from lapwing.services.mavlink.resolve import describe
from lapwing.services.scene_resolver import load

REQUESTED = {  # by QGroundControl's PX4 plug-in for multicopters, which shows a dialog if one is missing; by file
    "PX4AutoPilotPlugin.cc": "SYS_HITL COM_RC_IN_MODE",
    "AirframeComponent.cc, AirframeComponentSummary.qml": "SYS_AUTOSTART MAV_SYS_ID",
    "SensorsComponent.cc, SensorsComponentSummary.qml, SensorsSetup.qml": (
        "CAL_GYRO0_ID CAL_ACC0_ID CAL_MAG0_ID CAL_MAG1_ID CAL_MAG2_ID CAL_MAG0_ROT CAL_MAG1_ROT CAL_MAG2_ROT "
        "SYS_HAS_MAG SENS_BOARD_ROT SENS_BOARD_X_OFF SENS_BOARD_Y_OFF SENS_BOARD_Z_OFF SENS_DPRES_OFF"
    ),
    "PX4RadioComponent.cc, PX4RadioComponentSummary.qml": (
        "RC_MAP_ROLL RC_MAP_PITCH RC_MAP_YAW RC_MAP_THROTTLE RC_MAP_FLAPS RC_MAP_AUX1 RC_MAP_AUX2"
    ),
    "PX4SimpleFlightModes.qml": (
        "RC_MAP_FLTMODE COM_FLTMODE1 COM_FLTMODE2 COM_FLTMODE3 COM_FLTMODE4 COM_FLTMODE5 COM_FLTMODE6 RC_MAP_MODE_SW "
        "RC_MAP_ARM_SW RC_MAP_GEAR_SW RC_MAP_KILL_SW RC_MAP_LOITER_SW RC_MAP_OFFB_SW RC_MAP_RETURN_SW "
        "RC_ARMSWITCH_TH RC_GEAR_TH RC_KILLSWITCH_TH RC_LOITER_TH RC_OFFB_TH RC_RETURN_TH"
    ),
    "BatteryParams.qml": "BAT1_SOURCE BAT1_N_CELLS BAT1_V_CHARGED BAT1_V_EMPTY BAT1_V_LOAD_DROP",
    "SafetyComponent.qml, SafetyComponentSummary.qml": (
        "SDLOG_MODE GF_ACTION GF_MAX_HOR_DIST GF_MAX_VER_DIST RTL_RETURN_ALT RTL_DESCEND_ALT RTL_LAND_DELAY "
        "COM_LOW_BAT_ACT NAV_RCL_ACT NAV_DLL_ACT COM_DL_LOSS_T COM_RC_LOSS_T COM_DISARM_LAND CP_DIST COM_OBS_AVOID "
        "BAT_LOW_THR BAT_CRIT_THR BAT_EMERGEN_THR MPC_LAND_SPEED"
    ),
    "FailureInjectionComponent.qml, FailureInjection.cc": "SYS_FAILURE_EN SYS_FAIL_BAT_LVL",
    "PX4FirmwarePlugin.cc": "MPC_XY_VEL_MAX MIS_TAKEOFF_ALT",
    "PX4FlightModeIndicator.qml, PX4FlightBehaviorCopter.qml": "RTL_RETURN_ALT NAV_ACC_RAD",
}


def integer(message):
    return struct.unpack("<i", struct.pack("<f", message.param_value))[0]


def read(station, name):
    station.send("param_request_read", 1, 1, name.encode(), -1)
    return station.last("PARAM_VALUE")


def facts(scene, *overrides):
    """Return all parameters of a scene's vehicle."""
    description = describe(load(scene, overrides))
    values = {p.name: p.default for p in description.parameters}
    return {fact.name: fact.value(values) for fact in px4_facts(description)} | values


@pytest.mark.parametrize("page", REQUESTED)
def test_parameters_of_ground_station_pages_exist(page):
    scene = load("lapwing/scenes/groundstation.toml")
    assert not set(REQUESTED[page].split()) - set(facts("lapwing/scenes/groundstation.toml")) - set(table(scene))


def test_ground_station_requires_no_setup():
    result = facts("lapwing/scenes/groundstation.toml")
    assert result["SYS_AUTOSTART"] == 4001
    assert all(result[f"CAL_{name}0_ID"] for name in ("GYRO", "ACC", "MAG"))
    assert table(load("lapwing/scenes/groundstation.toml"))["COM_RC_IN_MODE"].default == 1.0
    assert (result["BAT1_N_CELLS"], result["BAT1_V_EMPTY"]) == (12, 3.0)


def test_missing_sensor_is_declared():
    result = facts("lapwing/scenes/hover.toml")
    assert result["BAT1_SOURCE"] == -1
    assert "BAT1_V_CHARGED" not in result
    assert result["SYS_HAS_NUM_DIST"] == 0
    assert facts("lapwing/scenes/delivery_mission.toml")["SYS_HAS_NUM_DIST"] == 1
    assert result["PD_GRIPPER_EN"] == 0  # QGroundControl hides the button
    assert facts("lapwing/scenes/delivery_full.toml")["PD_GRIPPER_EN"] == 1


def test_names_fit_field_and_are_unique():
    names = [fact.name for fact in px4_facts(describe(load("lapwing/scenes/groundstation.toml")))]
    assert max(map(len, names)) <= 16
    assert len(set(names)) == len(names)


def test_facts_are_listed_with_parameters_and_cannot_be_set():
    bench = Bench()
    station = bench.station()
    station.send("param_request_list", 1, 1)
    bench.step(20)
    result = {m.param_id: m for m in station.all("PARAM_VALUE")}
    assert {p.name for p in PARAMETERS} < set(result)
    assert len(result) == result["SYS_AUTOSTART"].param_count
    assert integer(result["SYS_AUTOSTART"]) == 4001
    assert sorted(m.param_index for m in result.values()) == list(range(len(result)))
    station.send("param_set", 1, 1, b"SYS_AUTOSTART", 0.0, mavlink.MAV_PARAM_TYPE_INT32)
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_READ_ONLY
    assert integer(station.last("PARAM_VALUE")) == 4001


def test_present_value_of_fact_is_acknowledged():
    bench = Bench()
    station = bench.station()
    set_whole(bench, station, "SYS_AUTOSTART", 4001)
    assert integer(station.last("PARAM_VALUE")) == 4001
    assert station.last("PARAM_ERROR") is None


def test_negative_index_reads_by_name():
    bench = Bench()
    station = bench.station()
    station.send("param_request_read", 1, 1, b"NAV_DLL_ACT", -2)
    assert station.last("PARAM_VALUE").param_id == "NAV_DLL_ACT"


def test_valid_value_is_not_out_of_range_when_too_many_wait():
    bench = Bench()
    station = bench.station()
    for k in range(300):
        station.send("param_set", 1, 1, b"MIS_TAKEOFF_ALT", 3.0 + 0.01 * k, mavlink.MAV_PARAM_TYPE_REAL32)
    bench.step(3)
    assert {m.error for m in station.all("PARAM_ERROR")} == {9}  # MAV_PARAM_ERROR_WRITE_FAIL
    assert len(station.all("PARAM_ERROR")) == 300 - 256


def test_parameter_change_is_broadcast_with_dependent_facts():
    bench = Bench()
    one, two = bench.station(), bench.station(system=254)
    assert integer(read(two, "GF_ACTION")) == 3  # return
    two.got.clear()
    three = struct.unpack("<f", struct.pack("<i", 3))[0]
    one.send("param_set", 1, 1, b"FS_FENCE_ACT", three, mavlink.MAV_PARAM_TYPE_INT32)
    bench.step(3)
    twice = 2 * [("FS_FENCE_ACT", 3), ("GF_ACTION", 5)]  # as in PX4: MAVSDK's subscriptions need it
    assert [(m.param_id, integer(m)) for m in two.all("PARAM_VALUE")] == twice
    assert [(m.param_id, integer(m)) for m in one.all("PARAM_VALUE")] == twice


def whole(value):
    return struct.unpack("<f", struct.pack("<i", value))[0]


def set_whole(bench, station, name, value):
    station.got.clear()
    station.send("param_set", 1, 1, name.encode(), whole(value), mavlink.MAV_PARAM_TYPE_INT32)
    bench.step(4)


@pytest.mark.parametrize(
    ("name", "value", "counterparts"),
    [
        ("GF_ACTION", 0, {"FS_FENCE_ACT": 0}),
        ("GF_ACTION", 2, {"FS_FENCE_ACT": 1}),
        ("GF_ACTION", 5, {"FS_FENCE_ACT": 3}),
        ("COM_LOW_BAT_ACT", 0, {"FS_BAT_CRIT_ACT": 0, "FS_BAT_EMER_ACT": 0}),
        ("COM_LOW_BAT_ACT", 2, {"FS_BAT_CRIT_ACT": 3, "FS_BAT_EMER_ACT": 3}),
        ("COM_ACT_FAIL_ACT", 3, {"FS_MOTOR_ACT": 2}),
        ("COM_ACT_FAIL_ACT", 1, {"FS_MOTOR_ACT": 1}),
        ("COM_ACT_FAIL_ACT", 4, {"FS_MOTOR_ACT": 5}),
        ("GF_ACTION", 4, {"FS_FENCE_ACT": 5}),
        ("RTL_APPR_FORCE", 1, {}),
    ],
)
def test_px4_parameter_sets_its_counterparts(name, value, counterparts):
    bench = Bench()
    station, other = bench.station(), bench.station(system=254)
    set_whole(bench, station, name, value)
    assert {k: bench.vehicle.parameters[k] for k in counterparts} == counterparts
    for each in (station, other):
        assert integer(read(each, name)) == value
    assert {integer(m) for m in other.all("PARAM_VALUE") if m.param_id == name} == {value}


@pytest.mark.parametrize(
    ("name", "value"), [("GF_ACTION", 6), ("COM_LOW_BAT_ACT", 1), ("COM_ACT_FAIL_ACT", 5), ("RTL_APPR_FORCE", 2)]
)
def test_px4_value_without_counterpart_is_rejected(name, value):
    bench = Bench()
    station = bench.station()
    before = integer(read(station, name))
    set_whole(bench, station, name, value)
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert integer(station.last("PARAM_VALUE")) == before


def test_changed_counterpart_is_shown_in_px4_parameter():
    bench = Bench()
    station = bench.station()
    set_whole(bench, station, "GF_ACTION", 0)
    set_whole(bench, station, "FS_FENCE_ACT", 2)
    assert integer(read(station, "GF_ACTION")) == 3


@pytest.mark.parametrize(
    "message",
    [
        ("param_request_list", ()),
        ("param_request_read", (b"MAV_SYS_ID", -1)),
        ("param_set", (b"MIS_TAKEOFF_ALT", 9.0, mavlink.MAV_PARAM_TYPE_REAL32)),
    ],
)
def test_parameter_message_to_all_systems_is_ignored(message):
    kind, fields = message
    bench = Bench()
    station = bench.station()
    station.send(kind, 0, 0, *fields)
    bench.step(5)
    assert not station.all("PARAM_VALUE")
    assert bench.vehicle.parameters["MIS_TAKEOFF_ALT"] == 2.5
    assert bench.counts["parameter message for all systems"] == 1
    station.send(kind, 1, 0, *fields)  # all components of the system
    bench.step(5)
    assert station.all("PARAM_VALUE")


def test_parameters_of_client_tests_exist():
    names = "COM_RCL_EXCEPT RTL_APPR_FORCE SIM_GPS_USED FD_ACT_EN MC_AIRMODE CA_FAILURE_MODE COM_ACT_FAIL_ACT"
    scene = "lapwing/scenes/hover.toml"
    assert set(names.split()) <= {*facts(scene), *table(load(scene))}
    assert table(load("lapwing/scenes/hover.toml"))["SYS_FAILURE_EN"].default == 1.0


def test_rejected_value_is_reported_to_sender_only():
    bench = Bench()
    one, two = bench.station(), bench.station(system=254)
    one.send("param_set", 1, 1, b"MIS_TAKEOFF_ALT", 1e6, mavlink.MAV_PARAM_TYPE_REAL32)
    bench.step(3)
    assert one.last("PARAM_VALUE").param_value == pytest.approx(2.5)
    assert two.last("PARAM_VALUE") is None


@pytest.mark.parametrize("name", ["NAV_DLL_ACT", "MIS_TAKEOFF_ALT", "GF_ACTION", "SYS_AUTOSTART"])
def test_parameter_of_other_type_is_rejected(name):
    bench = Bench()
    station = bench.station()
    before = read(station, name)
    other = ({mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32} - {before.param_type}).pop()
    station.send("param_set", 1, 1, name.encode(), 1.0, other)
    bench.step(3)
    assert station.last("PARAM_ERROR").error == 7  # MAV_PARAM_ERROR_TYPE_MISMATCH
    assert station.last("PARAM_VALUE").param_value == before.param_value


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9])
def test_ardupilot_rejects_non_integer(value):
    bench = Bench("mavlink.firmware=ardupilot")
    station = bench.station()
    station.send("param_set", 1, 1, b"NAV_DLL_ACT", value, mavlink.MAV_PARAM_TYPE_REAL32)
    bench.step(3)
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert station.last("PARAM_VALUE").param_value == 2.0


def test_ardupilot_has_no_px4_facts():
    bench = Bench("mavlink.firmware=ardupilot")
    station = bench.station()
    read(station, "SYS_AUTOSTART")
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
