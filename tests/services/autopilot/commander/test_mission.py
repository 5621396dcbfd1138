"""Complete missions of a vehicle that follows its setpoint exactly."""

import math
from itertools import groupby, pairwise

import pytest
from commander_session import Flight
from flights import command, item

pytestmark = pytest.mark.long

NAN = math.nan
START = command("mission"), command("arm")


def mission(*items, **more):
    return Flight(command("mission_upload", items=items), *START, **more)


def reached_items(flight):
    return [number for number, _ in groupby(s.mission_reached for _, s in flight.track) if number != 65535]


@pytest.mark.parametrize("last", [item("land", 4.0, 0.0, 0.0), item("return")], ids=["land", "return"])
def test_landed_mission_completes_disarms_and_repeats(last):
    flight = mission(item("takeoff", z=3.0), item("waypoint", 4.0, 0.0, 3.0), last, parameters={"RTL_RETURN_ALT": 3.0})
    for _ in range(2):
        assert flight.until(lambda s: s.mission_state == 5)
        assert flight.status.armed
        assert flight.until(lambda s: not s.armed, 3.0)
        assert (flight.status.mission_current, flight.status.mission_reached) == (2, 2)
        assert flight.status.mode == "hold"
        assert max(s.mission_current for _, s in flight.track) == 2
        flight.send(*START)
        assert (flight.status.mission_state, flight.status.mission_current) == (3, 0)
    assert reached_items(flight) == [0, 1, 2] * 2


def test_mission_is_started_and_armed_by_one_command():
    items = item("takeoff", z=3.0), item("waypoint", 4.0, 0.0, 3.0), item("land")
    flight = Flight(command("mission_upload", items=items)).send(command("mission_start", 1.0))
    assert (flight.status.mode, flight.status.armed, flight.status.mission_current) == ("mission", True, 1)
    assert flight.until(lambda s: s.mission_state == 5)
    other = Flight(command("mission_start"))
    assert not other.status.armed
    assert other.texts == ["mission: no mission is uploaded; upload one first"]


def test_mission_continues_after_landing_without_disarming():
    flight = mission(
        item("takeoff", z=3.0), item("land", 4.0, 0.0), item("delay", hold=5.0), item("takeoff", z=3.0),
        item("land", 0.0, 0.0),
    )  # fmt: skip
    assert flight.until(lambda s: s.mission_state == 5)
    assert all(s.armed for _, s in flight.track)
    assert reached_items(flight) == [0, 1, 2, 3, 4]
    assert flight.setpoint.position_world == pytest.approx((0.0, 0.0, 0.35), abs=0.1)


def test_vehicle_brakes_at_corner_but_not_on_straight_leg():
    far = [item("waypoint", 15.0 * k, 0.0, 3.0) for k in range(1, 5)]
    flight = mission(item("takeoff", z=3.0), *far, item("waypoint", 60.0, 40.0, 3.0))
    assert flight.until(lambda s: s.mission_state == 5)
    for k in (1, 2, 3):
        assert min(flight.speeds((15.0 * k, 0.0), 1.0)) > 4.9
    corner = flight.speeds((60.0, 0.0), 2.0)
    assert 1.0 < min(corner) < 3.0
    along = [
        s.position_world for s, _ in flight.track if 2.0 < s.position_world[0] < 57.0 and s.position_world[1] < 1.0
    ]
    assert max(abs(y) for _, y, _ in along) < 0.05
    up = [s.position_world[0] for s, _ in flight.track if s.position_world[1] > 15.0]
    assert max(abs(x - 60.0) for x in up) < 0.3  # on the line of the next leg
    assert flight.until(lambda s: s.mode == "hold")
    assert flight.setpoint.position_world == pytest.approx((60.0, 40.0, 3.0), abs=0.1)


def test_vehicle_stops_at_item_with_hold_time():
    flight = mission(
        item("takeoff", z=3.0), item("waypoint", 20.0, 0.0, 3.0, hold=1.0), item("waypoint", 40.0, 0.0, 3.0)
    )
    assert flight.until(lambda s: s.mission_state == 5)
    assert min(flight.speeds((20.0, 0.0), 0.2)) < 0.2


@pytest.mark.parametrize(
    ("mode", "yaw"), [(0, -0.5 * math.pi), (1, math.pi), (2, 0.0), (3, -0.5 * math.pi), (4, -0.5 * math.pi), (5, 0.0)]
)
def test_heading_follows_yaw_mode_parameter(mode, yaw):
    flight = mission(
        item("takeoff", z=3.0), item("waypoint", 20.0, 0.0, 3.0, hold=0.1), item("waypoint", 20.0, -6.0, 3.0),
        item("waypoint", 20.0, -6.1, 3.0, hold=9.0), parameters={"MPC_YAW_MODE": mode, "NAV_ACC_RAD": 0.2},
    )  # fmt: skip
    assert flight.until(lambda s: s.mission_current == 3)
    assert math.cos(flight.setpoint.yaw - yaw) > math.cos(0.5)


def test_item_yaw_overrides_heading_and_must_be_reached():
    flight = mission(item("takeoff", z=3.0), item("waypoint", 6.0, 0.0, 3.0, yaw=2.0), item("waypoint", 9.0, 0.0, 3.0))
    assert flight.until(lambda s: s.mission_current == 2)
    assert flight.setpoint.yaw == pytest.approx(2.0, abs=math.radians(12.0))


def test_mission_speed_ends_with_mission():
    flight = mission(item("takeoff", z=3.0), item("speed", values=(2.0,)), item("waypoint", 20.0, 0.0, 3.0))
    assert flight.until(lambda s: s.mission_state == 5)
    assert max(flight.speeds((10.0, 0.0), 3.0)) == pytest.approx(2.0, abs=0.01)
    flight.send(command("goto", 60.0, 0.0, 3.0)).fly_for(20.0)
    assert max(flight.speeds((40.0, 0.0), 3.0)) == pytest.approx(5.0, abs=0.01)


def test_heights_are_relative_to_home():
    flight = Flight(command("takeoff"), command("arm"))
    assert flight.until(lambda s: s.mode == "hold")
    assert flight.fly_for(2.0).setpoint.position_world[2] == pytest.approx(2.85, abs=0.05)
    flight.send(command("goto", 30.0, 0.0, 3.0)).fly_for(12.0).send(command("return")).fly_for(10.0)
    assert flight.setpoint.position_world[2] == pytest.approx(15.35, abs=0.05)


def test_item_without_effect_is_skipped():
    far = [i for k in range(1, 4) for i in (item("waypoint", 15.0 * k, 0.0, 3.0), item("delay"), item("delay"))]
    flight = mission(item("takeoff", z=3.0), *far)
    assert flight.until(lambda s: s.mission_state == 5)
    assert min(flight.speeds((15.0, 0.0), 1.0)) > 4.9
    assert reached_items(flight)[-1] == 9


def test_loiter_to_altitude_and_unlimited():
    flight = mission(item("takeoff", z=3.0), item("loiter_to_alt", 9.0, 0.0, 8.0), item("loiter", 9.0, 9.0, 8.0))
    assert flight.until(lambda s: s.mission_current == 2)
    over = [s.position_world for s, _ in flight.track if s.position_world[2] > 3.2]
    assert all(math.dist(p[:2], (9.0, 0.0)) < 0.5 for p in over)  # horizontally first, then vertically
    flight.fly_for(30.0)
    assert (flight.status.mission_current, flight.status.mission_state) == (2, 3)
    assert flight.status.phase == "item 3 of 3: hold until told otherwise at 9 m north, 9 m east, 7.65 m up"
    assert flight.setpoint.position_world == pytest.approx((9.0, 9.0, 8.0), abs=0.05)


def test_vehicle_that_an_obstacle_holds_lands_where_it_is():
    flight = mission(item("takeoff", z=3.0), item("waypoint", 40.0, 0.0, 3.0, hold=30.0), item("land"))
    flight.wall = 20.0
    assert flight.until(lambda s: s.failsafe != "")
    assert (flight.status.failsafe, flight.status.mode) == ("an obstacle holds the vehicle", "land")
    assert flight.setpoint.position_world[0] == pytest.approx(20.0, abs=0.1)
    assert flight.until(lambda s: not s.armed)
    assert "an obstacle holds the vehicle" in "".join(flight.texts)


def test_heading_follows_region_of_interest():
    flight = mission(
        item("takeoff", z=3.0), item("roi", 20.0, 20.0, 0.0), item("waypoint", 20.0, 0.0, 3.0, hold=1.0),
        item("roi"), item("waypoint", 40.0, 0.0, 3.0, hold=2.0),
    )  # fmt: skip
    assert flight.until(lambda s: s.mission_current == 4)
    assert flight.setpoint.yaw == pytest.approx(0.5 * math.pi, abs=0.05)
    assert flight.until(lambda s: s.mission_state == 5)
    assert flight.setpoint.yaw == pytest.approx(0.0, abs=0.05)
    flight.send(command("roi", 40.0, -30.0, 0.0)).fly_for(6.0)
    assert flight.setpoint.yaw == pytest.approx(-0.5 * math.pi, abs=0.05)


def test_conditions_delay_items_without_stop():
    for condition in (item("condition", radius=10.0), item("condition", hold=4.0)):
        flight = mission(
            item("takeoff", z=3.0), condition, item("speed", values=(2.0,)), item("waypoint", 40.0, 0.0, 3.0)
        )
        assert flight.until(lambda s: s.mission_state == 5)
        assert max(flight.speeds((10.0, 0.0), 2.0)) > 3.5
        assert max(flight.speeds((36.0, 0.0), 1.0)) == pytest.approx(2.0, abs=0.2)


def test_mission_items_set_relative_yaw_and_home():
    flight = mission(
        item("takeoff", z=3.0), item("waypoint", 0.0, 9.0, 3.0, hold=3.0), item("yaw", yaw=-1.0, values=(1.0,)),
        item("set_home"), item("waypoint", 9.0, 9.0, 3.0), item("return"), parameters={"MPC_YAW_MODE": 5},
    )  # fmt: skip
    assert flight.until(lambda s: s.mission_current == 4)
    assert flight.setpoint.yaw == pytest.approx(-1.0, abs=math.radians(12.0))
    assert flight.until(lambda s: s.mission_state == 5)
    assert flight.setpoint.position_world[:2] == pytest.approx((0.0, 9.0), abs=0.3)


@pytest.mark.parametrize("turns", [1.5, -1.0])
def test_mission_circles_around_position_as_often_as_asked(turns):
    values = (turns * math.tau, 2.0, math.nan)
    circle = item("orbit", 20.0, 0.0, 6.0, radius=5.0, values=values)
    flight = mission(item("takeoff", z=3.0), circle, item("waypoint", 0.0, 0.0, 6.0))
    assert flight.until(lambda s: s.mission_current == 1)
    flight.track.clear()
    assert flight.until(lambda s: s.mission_current == 2)
    places = [s.position_world for s, _ in flight.track]
    on_circle = [p for p in places if math.dist(p[:2], (20.0, 0.0)) < 5.5]
    steps = [math.remainder(math.atan2(b[1], b[0] - 20.0) - math.atan2(a[1], a[0] - 20.0), math.tau)
             for a, b in pairwise(on_circle)]  # fmt: skip
    assert sum(steps) == pytest.approx(turns * math.tau, abs=0.5)
    assert places[-1][2] == pytest.approx(6.0, abs=0.1)
    assert flight.until(lambda s: s.mission_state == 5)


def test_orbit_faces_its_centre():
    flight = Flight(command("takeoff", 5.0), command("arm"))
    assert flight.until(lambda s: s.mode == "hold")
    flight.send(command("orbit", 20.0, 0.0, 8.0, 8.0, 2.0)).fly_for(25.0)
    flight.track.clear()
    flight.fly_for(25.0)
    places = [s.position_world for s, _ in flight.track]
    assert all(math.dist(p[:2], (20.0, 0.0)) == pytest.approx(8.0, abs=0.2) for p in places)
    assert all(p[2] == pytest.approx(8.0, abs=0.1) for p in places)
    bearings = [math.atan2(p[1], p[0] - 20.0) for p in places]
    assert math.remainder(bearings[250] - bearings[0], 2.0 * math.pi) == pytest.approx(0.25, abs=0.03)  # to the left
    facing = flight.setpoint.yaw - bearings[-1] - math.pi
    assert math.cos(facing) > 0.9
    assert flight.status.mode == "orbit"
