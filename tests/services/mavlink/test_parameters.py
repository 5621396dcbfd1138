"""Parameters: the autopilot's, and the facts that PX4's ground stations ask for; changes reach every station."""

import struct

import pytest
from adapter_harness import Bench
from fake_vehicle import PARAMETERS

from lapwing.services.common.autopilot_parameters import table
from lapwing.services.mavlink.dialect import mavlink
from lapwing.services.mavlink.px4_facts import px4_facts
from lapwing.services.mavlink.resolve import describe
from lapwing.services.scene_resolver import load

ASKED = {  # by QGroundControl's PX4 plug-in of a multicopter, where a lack opens a dialog; by its files, 2020 to now
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
    description = describe(load(scene, overrides))
    values = {p.name: p.default for p in description.parameters}
    return {fact.name: fact.value(values) for fact in px4_facts(description)}


@pytest.mark.parametrize("page", ASKED)
def test_everything_that_the_pages_ask_for_is_there(page):
    scene = load("lapwing/scenes/groundstation.toml")
    assert not set(ASKED[page].split()) - set(facts("lapwing/scenes/groundstation.toml")) - set(table(scene))


def test_nothing_asks_for_set_up():
    found = facts("lapwing/scenes/groundstation.toml")
    assert found["SYS_AUTOSTART"] == 4001
    assert all(found[f"CAL_{name}0_ID"] for name in ("GYRO", "ACC", "MAG"))
    assert found["COM_RC_IN_MODE"] == 1
    assert (found["BAT1_N_CELLS"], found["BAT1_V_EMPTY"]) == (12, 3.0)


def test_what_is_not_fitted_says_so():
    found = facts("lapwing/scenes/hover.toml")
    assert found["BAT1_SOURCE"] == -1
    assert "BAT1_V_CHARGED" not in found
    assert found["SYS_HAS_NUM_DIST"] == 0
    assert facts("lapwing/scenes/delivery_mission.toml")["SYS_HAS_NUM_DIST"] == 1
    assert found["PD_GRIPPER_EN"] == 0  # QGroundControl hides the button
    assert facts("lapwing/scenes/delivery_full.toml")["PD_GRIPPER_EN"] == 1


def test_names_fit_into_their_field_and_none_is_there_twice():
    names = [fact.name for fact in px4_facts(describe(load("lapwing/scenes/groundstation.toml")))]
    assert max(map(len, names)) <= 16
    assert len(set(names)) == len(names)


def test_facts_are_listed_with_the_parameters_and_cannot_be_set():
    bench = Bench()
    station = bench.station()
    station.send("param_request_list", 1, 1)
    bench.step(20)
    found = {m.param_id: m for m in station.all("PARAM_VALUE")}
    assert {p.name for p in PARAMETERS} < set(found)
    assert len(found) == found["SYS_AUTOSTART"].param_count
    assert integer(found["SYS_AUTOSTART"]) == 4001
    assert sorted(m.param_index for m in found.values()) == list(range(len(found)))
    station.send("param_set", 1, 1, b"SYS_AUTOSTART", 0.0, mavlink.MAV_PARAM_TYPE_INT32)
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_READ_ONLY
    assert integer(station.last("PARAM_VALUE")) == 4001


def test_a_change_is_told_to_every_station_with_what_follows_from_it():
    bench = Bench()
    one, two = bench.station(), bench.station(system=254)
    assert integer(read(two, "NAV_RCL_ACT")) == 2  # return, as for the data link
    two.got.clear()
    three = struct.unpack("<f", struct.pack("<i", 3))[0]
    one.send("param_set", 1, 1, b"NAV_DLL_ACT", three, mavlink.MAV_PARAM_TYPE_INT32)
    bench.step(3)
    assert [(m.param_id, integer(m)) for m in two.all("PARAM_VALUE")] == [("NAV_DLL_ACT", 3), ("NAV_RCL_ACT", 3)]
    assert [m.param_id for m in one.all("PARAM_VALUE")] == ["NAV_DLL_ACT", "NAV_RCL_ACT"]


def test_a_refused_value_is_told_to_the_asker_alone():
    bench = Bench()
    one, two = bench.station(), bench.station(system=254)
    one.send("param_set", 1, 1, b"MIS_TAKEOFF_ALT", 1e6, mavlink.MAV_PARAM_TYPE_REAL32)
    bench.step(3)
    assert one.last("PARAM_VALUE").param_value == pytest.approx(2.5)
    assert two.last("PARAM_VALUE") is None


def test_ardupilot_has_none_of_px4s():
    bench = Bench("mavlink.flavour=ardupilot")
    station = bench.station()
    read(station, "SYS_AUTOSTART")
    assert station.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
