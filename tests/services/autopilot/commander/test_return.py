"""Return mode: goal, altitude, and path around the fence."""

import itertools
import math

import pytest
from commander_session import Flight
from flights import command, item

from lapwing.services.autopilot.commander.geofence_routing import route_around
from lapwing.services.common.plans.fence import Fence
from lapwing.services.common.plans.route_checks import breach_of

BOX = [(10.0, -15.0), (20.0, -15.0), (20.0, 10.0), (10.0, 10.0)]


def polygon(action, corners):
    return [item(action, x, y, 0.0, values=(float(len(corners)),)) for x, y in corners]


def lengths(fence, start, goal):
    way = [start, *route_around(fence, start, goal)]
    for a, b in itertools.pairwise(way):
        for k in range(101):
            assert fence.allows(a[0] + 0.01 * k * (b[0] - a[0]), a[1] + 0.01 * k * (b[1] - a[1]))
    return sum(math.dist(a, b) for a, b in itertools.pairwise(way))


def test_route_around_fence_is_short_and_inside():
    out = Fence(polygon("fence_exclusion", BOX))
    assert 38.0 < lengths(out, (30.0, 0.0), (0.0, 0.0)) < 42.0
    assert lengths(out, (30.0, 20.0), (0.0, 20.0)) == 30.0
    circle = Fence([item("fence_circle_out", 15.0, 0.0, 0.0, radius=8.0)])
    assert 34.0 < lengths(circle, (30.0, 0.0), (0.0, 0.0)) < 37.0
    bay = Fence(
        polygon("fence_inclusion", [(-9, -9), (40, -9), (40, 40), (30, 40), (30, 5), (5, 5), (5, 40), (-9, 40)])
    )
    assert lengths(bay, (35.0, 30.0), (0.0, 30.0)) > 70.0


def session_away(*commands, **parameters):
    flight = Flight(command("takeoff", 5.0), command("arm"), parameters={"RTL_RETURN_ALT": 5.0} | parameters)
    assert flight.until(lambda s: s.mode == "hold")
    return flight.send(*commands, command("goto", 30.0, 0.0, 5.0)).fly_for(15.0)


def test_return_flies_around_fence():
    fence = Fence(polygon("fence_exclusion", BOX))
    flight = session_away()
    flight.track.clear()
    flight.send(command("fence_upload", items=polygon("fence_exclusion", BOX)), command("return"))
    assert flight.until(lambda s: not s.armed)
    assert all(fence.allows(*s.position_world[:2]) for s, _ in flight.track)
    assert flight.setpoint.position_world[:2] == pytest.approx((0.0, 0.0), abs=0.3)


@pytest.mark.parametrize(
    ("kind", "rally", "end"),
    [
        (0, (80.0, 0.0), (0.0, 0.0)),  # home is nearer
        (0, (40.0, 0.0), (40.0, 0.0)),
        (1, (40.0, 0.0), (30.0, 30.0)),
        (2, (40.0, 0.0), (30.0, 30.0)),
        (3, (40.0, 0.0), (40.0, 0.0)),
        (3, (80.0, 0.0), (0.0, 0.0)),
    ],
)
def test_return_goal_follows_rtl_type(kind, rally, end):
    items = [item("takeoff", z=5.0), item("waypoint", 30.0, 20.0, 5.0), item("land", 30.0, 30.0, 0.0)]
    flight = session_away(
        command("mission_upload", items=items),
        command("rally_upload", items=[item("rally", *rally, 5.0)]),
        RTL_TYPE=kind,
    )
    flight.send(command("return"))
    assert flight.until(lambda s: not s.armed)
    assert flight.setpoint.position_world[:2] == pytest.approx(end, abs=0.3)
    assert (min(flight.speeds((30.0, 20.0), 3.0), default=None) is None) == (kind not in (1, 2))


def test_return_waits_at_configured_height():
    flight = session_away(RTL_LAND_DELAY=5.0, RTL_DESCEND_ALT=3.0)
    flight.send(command("return"))
    assert flight.until(lambda s: s.phase == "wait")
    assert flight.setpoint.position_world == pytest.approx((0.0, 0.0, 3.35), abs=0.35)
    start = flight.time
    assert flight.until(lambda s: s.mode == "land")
    assert flight.time - start == pytest.approx(5.0, abs=0.1)


def test_circle_that_leaves_the_fence_is_refused():
    fence = Fence([item("fence_circle_in", 0.0, 0.0, 0.0, radius=12.0)])
    assert breach_of(fence, item("orbit", 8.0, 0.0, 6.0, radius=5.0, values=(6.0, 2.0, math.nan)))
    assert not breach_of(fence, item("orbit", 6.0, 0.0, 6.0, radius=5.0, values=(6.0, 2.0, math.nan)))
