"""Messages of the mission protocol: uploads go to the store, downloads are served item by item."""

import math
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import degrees, to_world
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.session import Session

GUIDED, GUIDED_ALTITUDE = 2, 3  # "current" of an item that is a guided target, or a guided altitude
EXACT = 1e7  # [1/deg] resolution of MISSION_ITEM_INT


@handles("MISSION_COUNT")
def count(session: Session, m: Any) -> None:
    """Start an upload of `count` items; denied to endpoints that are not trusted."""
    if session.trusted:
        session.missions.begin(session.endpoint, m.mission_type, m.count)
    else:
        _reply(session, m.mission_type, mavlink.MAV_MISSION_DENIED)


@handles("MISSION_ITEM_INT")
def item_int(session: Session, m: Any) -> None:
    """Handle an item of an upload or, from ArduPilot's ground stations, a position to fly to."""
    if m.current not in (GUIDED, GUIDED_ALTITUDE):
        session.missions.add_item(session.endpoint, m)
        return
    try:
        x, y, z = to_world(session.vehicle.datum, m.frame, degrees(m.x), degrees(m.y), m.z)
    except ValueError:
        _reply(session, m.mission_type, mavlink.MAV_MISSION_INVALID)
        return
    if not session.trusted:
        _reply(session, m.mission_type, mavlink.MAV_MISSION_DENIED)
        return

    def on_acknowledgement(acknowledgement: Any) -> None:
        accepted = acknowledgement.result == mavlink.MAV_RESULT_ACCEPTED
        _reply(session, m.mission_type, mavlink.MAV_MISSION_ACCEPTED if accepted else mavlink.MAV_MISSION_DENIED)

    altitude_only = m.current == GUIDED_ALTITUDE
    session.command("goto", (math.nan if altitude_only else x, math.nan if altitude_only else y, z), on_acknowledgement)


@handles("MISSION_ITEM")
def item(session: Session, m: Any) -> None:
    """Handle an item with floating-point coordinates; see `item_int`."""
    if not (abs(m.x) <= 180.0 and abs(m.y) <= 180.0):
        _reply(session, m.mission_type, mavlink.MAV_MISSION_INVALID)
        session.missions.cancel(session.endpoint, m.mission_type)
        return
    fields = m.frame, m.command, m.current, m.autocontinue, m.param1, m.param2, m.param3, m.param4
    position = round(m.x * EXACT), round(m.y * EXACT), m.z
    integer_item = mavlink.MAVLink_mission_item_int_message(
        m.target_system, m.target_component, m.seq, *fields, *position, m.mission_type
    )
    item_int(session, integer_item)


@handles("MISSION_REQUEST_LIST")
def request_list(session: Session, m: Any) -> None:
    """Start a download."""
    session.missions.forget(session.endpoint, m.mission_type)
    items = session.missions.items.get(m.mission_type)
    if items is None:
        _reply(session, m.mission_type, mavlink.MAV_MISSION_UNSUPPORTED)
    else:
        session.send(mavlink.MAVLink_mission_count_message(*session.address, len(items), m.mission_type))


@handles("MISSION_REQUEST_INT", "MISSION_REQUEST")
def request_item(session: Session, m: Any) -> None:
    """Send an item of a download."""
    items = session.missions.items.get(m.mission_type, [])
    if m.seq >= len(items):
        _reply(session, m.mission_type, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        return
    i = items[m.seq]
    fields = i.command, int(session.vehicle.status.mission_current == m.seq), i.autocontinue
    params = i.param1, i.param2, i.param3, i.param4
    target = *session.address, m.seq, i.frame
    if m.get_type() == "MISSION_REQUEST_INT":
        reply = mavlink.MAVLink_mission_item_int_message(*target, *fields, *params, i.x, i.y, i.z, m.mission_type)
    else:
        position = i.x / EXACT, i.y / EXACT, i.z
        reply = mavlink.MAVLink_mission_item_message(*target, *fields, *params, *position, m.mission_type)
    session.send(reply)


@handles("MISSION_ACK")
def acknowledged(session: Session, m: Any) -> None:
    """Handle the end of a download or the cancellation of an upload."""
    session.missions.cancel(session.endpoint, m.mission_type)


@handles("MISSION_CLEAR_ALL")
def clear(session: Session, m: Any) -> None:
    """Delete a mission, a fence, the rally points, or all of them."""
    if session.trusted:
        session.missions.clear(session.endpoint, m.mission_type)
    else:
        _reply(session, m.mission_type, mavlink.MAV_MISSION_DENIED)


@handles("MISSION_SET_CURRENT")
def set_current(session: Session, m: Any) -> None:
    """Continue with another item; MISSION_CURRENT reports the change."""
    if session.trusted:
        session.command("mission_current", (m.seq,))


def _reply(session: Session, kind: int, result: int) -> None:
    session.send(mavlink.MAVLink_mission_ack_message(*session.address, result, kind))
