"""Missions that no client has uploaded: their MAVLink form has the same items."""

import math

import pytest
from adapter_harness import Bench

from lapwing.messages import CommandAck, CommandAcks, MissionItem, OperatorCommand, OperatorInput, Vector3, header
from lapwing.messages.topics import COMMAND_ACKS, OPERATOR
from lapwing.services.common.mavlink.geo_coordinates import Datum
from lapwing.services.common.mavlink.mission_export import to_mavlink
from lapwing.services.common.plans.converter import convert
from lapwing.services.mavlink.mission_store import plan_items

NAN = math.nan


def item(action, x=NAN, y=NAN, z=NAN, yaw=NAN, radius=NAN, hold=0.0, values=()):
    return MissionItem(action, Vector3(x, y, z), yaw, radius, hold, values)


ITEMS = [
    item("takeoff", z=4.0, yaw=1.0),
    item("waypoint", 120.0, -340.0, 25.0, yaw=-2.0, radius=1.5, hold=3.0),
    item("waypoint", 0.5, 0.25, 3.0),
    item("loiter_time", 10.0, 20.0, 5.0, hold=7.0),
    item("delay", hold=2.0),
    item("speed", values=(3.0,)),
    item("yaw", yaw=0.5),
    item("jump", values=(1.0, 2.0)),
    item("return"),
    item("loiter", 10.0, 20.0, 5.0, yaw=0.5),
    item("loiter_to_alt", 10.0, 20.0, 50.0),
    item("orbit", 10.0, 20.0, 50.0, radius=8.0, values=(-4.0, NAN, NAN)),
    item("orbit", 10.0, 20.0, 50.0, radius=8.0, values=(4.0, 2.0, 3.0)),
    item("roi", 10.0, 20.0, 5.0),
    item("roi"),
    item("set_home", 1.0, 2.0, 0.5),
    item("set_home"),
    item("gripper", values=(0.0,)),
    item("condition", hold=3.0),
    item("condition", radius=8.0),
    item("yaw", yaw=-0.5, values=(1.0,)),
    item("yaw", yaw=-0.5, values=(0.0, 1.0)),
    item("speed", values=(NAN,)),
    item("land", 3.0, 4.0, 0.0, yaw=0.0),
]
FENCE = [item("fence_circle_in", 5.0, 5.0, 0.0, radius=50.0, values=(50.0,))]
FENCE += [item("fence_exclusion", x, y, 0.0, values=(3.0,)) for x, y in ((1.0, 1.0), (2.0, 1.0), (2.0, 3.0))]
RALLY = [item("rally", 30.0, 40.0, 10.0)]


@pytest.mark.parametrize(
    ("items", "kind"),
    [(ITEMS, 0), (FENCE, 1), (RALLY, 2)],  # MAV_MISSION_TYPE
)
def test_mission_upload_and_download_are_equal(items, kind):
    places = (
        "takeoff",
        "waypoint",
        "loiter_time",
        "land",
        "loiter",
        "loiter_to_alt",
        "orbit",
        "roi",
        "set_home",
        "rally",
        *[i.action for i in FENCE],
    )
    datum = Datum(home_z=0.35)
    for before, after in zip(
        items, convert(plan_items(to_mavlink(items, kind, datum), False), kind, datum), strict=True
    ):
        assert after.action == before.action
        if before.action in places:
            assert tuple(after.position) == pytest.approx(tuple(before.position), abs=0.02, nan_ok=True)  # 1e-7 degrees
        for name in ("yaw", "radius", "hold_time"):
            assert getattr(after, name) == pytest.approx(getattr(before, name), abs=1e-6, nan_ok=True), before.action
        assert after.values == pytest.approx(before.values, rel=1e-6, nan_ok=True)


def external_command(bench, time_ns, command, result):
    """Send a command of another sender to the autopilot, with its acknowledgement."""
    bench.adapter.handle(
        COMMAND_ACKS,
        time_ns,
        CommandAcks(header(time_ns, ""), (CommandAck(command.source, command.id, result),)).encode(),
        0.0,
    )
    bench.adapter.handle(OPERATOR, time_ns, OperatorInput(header(time_ns, ""), (command,)).encode(), 0.0)


def test_accepted_plan_is_downloadable_and_rejected_is_not():
    bench = Bench()
    station = bench.station()
    bench.step(5)
    external_command(bench, 0, OperatorCommand("mission_upload", "plan", 1, (), "", tuple(ITEMS)), CommandAck.ACCEPTED)
    external_command(bench, 0, OperatorCommand("fence_upload", "plan", 2, (), "", tuple(FENCE)), CommandAck.DENIED)
    for kind, count in ((0, len(ITEMS)), (1, 0)):
        station.send("mission_request_list", 1, 1, kind)
        assert station.last("MISSION_COUNT").count == count
    station.send("mission_request_int", 1, 1, 1, 0)
    result = station.last("MISSION_ITEM_INT")
    assert (result.command, result.param1, result.frame) == (16, 3.0, 6)
    assert result.z == pytest.approx(24.65, abs=0.02)  # above home; the body origin at rest is 0.35 m above the ground
