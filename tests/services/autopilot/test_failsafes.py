"""Failsafes in flight."""

from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
from flights import ACCEPTED, REJECTED, UP, at, command, fly, height, item, mode, place, results, sent_texts

from lapwing.services.scene_resolver import load
from tests.combinations import rest_nightly
from tests.cosim import memory_log

pytestmark = pytest.mark.long


def airframe(tmp_path, capacity):
    """Return the override of a delivery drone's file with another battery capacity [A s]."""
    text = Path("lapwing/scenes/vehicles/delivery_drone.toml").read_text(encoding="utf-8")
    path = tmp_path / "small.toml"
    path.write_text(text.replace("capacity = 36000.0", f"capacity = {capacity}"), encoding="utf-8")
    return f"vehicle.airframe={path}"


def warnings(flight):
    return [int(w) for w in flight.column("status", lambda m: m.battery_warning)]


def test_emptying_battery_warns_then_returns_then_lands(tmp_path):
    script = UP | {6: [command("goto", 10.0, 0.0, 3.0)]}
    small = [
        airframe(tmp_path, 12000.0),
        "effects.battery.initial_charge=0.2",
        "autopilot.parameters.RTL_RETURN_ALT=3.0",
    ]
    flight = fly(80, script, *small)
    reported = sent_texts(flight)
    order = [reported.index(t) for t in ("the battery is low", "the battery is critical: return", "landed")]
    assert order == sorted(order)
    charge = flight.column("battery", lambda m: m.percentage)
    assert charge[0] == pytest.approx(0.2, abs=1e-3)
    assert np.all(np.diff(charge) <= 0.0)
    assert sorted(set(warnings(flight)))[:3] == [0, 1, 2]
    assert place(flight, 80.0)[:2] == pytest.approx((0.0, 0.0), abs=0.1)
    assert not at(flight, "status", 80.0, lambda m: m.armed)


def test_nearly_empty_battery_lands_immediately(tmp_path):
    script = UP | {6: [command("goto", 30.0, 0.0, 3.0)]}
    low = [airframe(tmp_path, 4000.0), "effects.battery.initial_charge=0.18", "autopilot.parameters.FS_BAT_CRIT_ACT=0"]
    flight = fly(40, script, *low)
    assert "the battery is nearly empty: land" in sent_texts(flight)
    assert place(flight, 40.0)[0] > 5.0
    assert height(flight, 40.0) == pytest.approx(0.35, abs=0.05)


def test_critical_battery_prevents_arming():
    script = {0.04: [command("arm", id=1)]}
    flight = fly(0.5, script, "effects.battery.initial_charge=0.06")
    assert results(flight)[1] == REJECTED
    assert "Arming denied: the battery is low: 6%" in sent_texts(flight)
    flight = fly(0.5, script)
    assert np.all(np.isnan(flight.column("battery", lambda m: m.percentage)))
    assert results(flight)[1] == 0


@pytest.mark.parametrize("rotor", [1, 2, 3, 4])
def test_damaged_rotor_is_named_and_vehicle_lands(rotor):
    damage = [f"effects.rotor_damage.rotor={rotor}", "effects.rotor_damage.time=8.0"]
    damage += ["effects.rotor_damage.remaining_thrust=0.55", "effects.rotor_damage.remaining_torque=0.55"]
    flight = fly(20, UP, *damage)
    assert "a motor has failed: land" in sent_texts(flight)
    failed = flight.column("status", lambda m: m.failed_motor)
    times = flight.times("status")
    assert set(failed[times < 8.0]) == {0}
    assert failed[times > 9.0][0] == rotor  # theory, eq. (4.26b): 0.88 s for this loss of 45 %
    assert not at(flight, "status", 20.0, lambda m: m.armed)


def test_lost_rotor_is_detected_before_fall():
    damage = ["effects.rotor_damage.rotor=3", "effects.rotor_damage.time=8.0"]
    flight = fly(9, {0.04: [command("takeoff", 10.0), command("arm")]}, *damage)
    failed, times = flight.column("status", lambda m: m.failed_motor), flight.times("status")
    assert failed[times >= 8.3 - 1e-6][0] == 3
    assert height(flight, 8.3) > 4.0


GPS_LOST = 'sensors.gps.faults=[{kind="dropout", start=%g, stop=%g}]'
SENSORS = [
    "autopilot.estimator=kalman", "sensors.imu.preset=mpu6000", "sensors.gps.preset=rtk", "sensors.magnetometer={}",
    "sensors.barometer={}", "autopilot.parameters.COM_POS_FS_DELAY=3.0",
]  # fmt: skip


def test_lost_position_warns_then_descends():
    flight = fly(30, UP | {1.0: [command("takeoff", 3.0), command("arm")]}, *SENSORS, GPS_LOST % (10.0, 1e9))
    assert "the position is lost: descend in 2 s" in sent_texts(flight)
    assert "the position is lost: descend" in sent_texts(flight)
    assert mode(flight, 11.5) == "hold"
    assert mode(flight, 15.5) == "descend"
    assert height(flight, 30.0) == pytest.approx(0.35, abs=0.05)
    assert np.hypot(*place(flight, 30.0)[:2]) < 2.0


def test_position_loss_hands_over_to_manual_control():
    sticks = {(9.0, 20.0): [command("manual", 0.3, 0.0, 0.0, 0.0)], 16.0: [command("goto", 5.0, 0.0, 3.0, id=1)]}
    script = UP | {1.0: [command("takeoff", 3.0), command("arm")]} | sticks
    flight = fly(26, script, *SENSORS, GPS_LOST % (10.0, 24.0))
    assert "the position is lost: altitude_control" in sent_texts(flight)
    assert mode(flight, 18.0) == "altitude_control"
    assert height(flight, 18.0) == pytest.approx(3.0, abs=0.3)
    assert results(flight)[1] == REJECTED
    assert "goto: the position is lost" in sent_texts(flight)
    assert place(flight, 20.0)[0] > 2.0  # forward
    assert mode(flight, 23.0) == "descend"  # the sticks are lost
    assert mode(flight, 26.0) == "return"  # the position has returned, but the sticks are lost


STICKS = UP | {(5.0, 7.0): [command("manual", 0.0, 0.0, 0.0, 0.0)]}  # centred


@pytest.mark.parametrize(
    ("mode_name", "settings", "after"),
    [
        ("position_control", [], "return"),
        ("position_control", ["COM_RC_LOSS_T=3.0"], "position_control"),
        ("position_control", ["NAV_RCL_ACT=3", "COM_RCL_EXCEPT=31"], "land"),  # this mode needs sticks
        ("hold", ["NAV_RCL_ACT=3"], "land"),
        ("hold", ["COM_RCL_EXCEPT=5"], "return"),
        ("hold", ["COM_RCL_EXCEPT=2"], "hold"),
        ("hold", ["COM_RC_IN_MODE=4"], "hold"),
    ],
)
def test_lost_sticks_act_by_mode(mode_name, settings, after):
    flight = fly(9, STICKS | {4.9: [command(mode_name)]}, *[f"autopilot.parameters.{text}" for text in settings])
    assert mode(flight, 7.8) == mode_name
    assert mode(flight, 8.4) == ("land" if after == "return" else after)  # home is below
    assert (f"the sticks are lost: {after}" in sent_texts(flight)) == (after != mode_name)


@pytest.mark.parametrize(("exempt", "after"), [(0, "return"), (6, "return"), (1, "mission")])
def test_lost_sticks_in_mission_act_unless_exempt(exempt, after):
    items = [item("takeoff", z=3.0), item("waypoint", 30.0, 0.0, 3.0)]
    script = {0.04: [command("mission_upload", items=items), command("mission_start")]}
    script[(1.0, 4.0)] = [command("manual", 0.0, 0.0, 0.0, 0.0)]
    flight = fly(6, script, f"autopilot.parameters.COM_RCL_EXCEPT={exempt}")
    assert (mode(flight, 4.8), mode(flight, 5.5)) == ("mission", after)


def test_sticks_lost_at_arming_are_optional():
    script = {0.04: [command("manual", 0.0, 0.0, 0.0, 0.0)], 3.0: [command("takeoff", 3.0), command("arm")]}
    flight = fly(8, script)
    assert not at(flight, "status", 8.0, lambda m: m.failsafe)
    assert height(flight, 8.0) > 2.0


def test_maximum_distances_from_home_are_fence():
    limits = [f"autopilot.parameters.{text}" for text in ("GF_MAX_HOR_DIST=5", "GF_MAX_VER_DIST=6", "FS_FENCE_ACT=1")]
    places = {
        5.0: [command("goto", 5.5, 0.0, 3.0, id=1), command("goto", 3.0, 0.0, 6.5, id=2)],
        5.1: [command("goto", 0.0, 4.0, 5.0, id=3), command("position_control")],
    }
    flight = fly(12, UP | places | {(5.2, 12.0): [command("manual", 0.6, 0.0, 0.0, 0.0)]}, *limits)
    assert [results(flight)[k] for k in (1, 2, 3)] == [REJECTED, REJECTED, ACCEPTED]
    assert "the vehicle is too far from home: hold" in sent_texts(flight)
    assert "go to: the position is too high above home" in sent_texts(flight)
    assert 5.0 < np.hypot(*place(flight, 12.0)[:2]) < 9.0
    rising = UP | {5.1: [command("position_control")], (5.2, 12.0): [command("manual", 0.0, 0.0, 0.5, 0.0)]}
    flight = fly(12, rising, *limits)
    assert "the vehicle is too high above home: hold" in sent_texts(flight)
    assert 6.35 < height(flight, 12.0) < 8.0


def test_maximum_height_ends_trajectory_of_scene():
    limits = "autopilot.parameters.GF_MAX_VER_DIST=0.5", "autopilot.parameters.FS_FENCE_ACT=1"
    flight = fly(6, {}, *limits, operated=False)
    modes = [name for name, _ in groupby(flight.column("status", lambda m: m.mode))]
    assert modes == ["mission", "hold"]


def test_trajectory_ends_when_position_returns_without_operator():
    soon = "autopilot.parameters.COM_POS_FS_DELAY=0.5"
    flight = fly(20, {}, *SENSORS, GPS_LOST % (3.0, 4.0), soon, operated=False)
    modes = [name for name, _ in groupby(flight.column("status", lambda m: m.mode))]
    assert modes == ["mission", "descend", "land", "hold"]
    assert height(flight, 20.0) == pytest.approx(0.35, abs=0.05)
    assert flight.landed
    assert at(flight, "setpoint", 6.0, lambda m: m.position.z) < 1.0  # the commander's setpoint, not the trajectory


@pytest.mark.parametrize("seed", rest_nightly(1, 2, 3))
@pytest.mark.parametrize("wind", [(3.0, 1.0), (8.0, 3.0)])
def test_delivery_mission_raises_no_motor_alarm(seed, wind):
    mean, sigma = wind
    sets = [
        f"run.seed={seed}",
        f"effects.random_wind_force.mean=[{mean}, 1.0, 0.0]",
        f"effects.random_wind_force.sigma={sigma}",
    ]
    flight = memory_log.fly(load("delivery_mission", sets))
    assert set(flight.column("status", lambda m: m.failed_motor)) == {0}
    assert set(flight.column("status", lambda m: m.mode)) == {"mission"}
    assert flight.landed
