"""The mission protocol's messages: uploads go to the store, downloads are answered item by item."""

from typing import TYPE_CHECKING, Any

from services.mavlink.client import Client
from services.mavlink.dialect import mavlink
from services.mavlink.protocols.handler import handles

if TYPE_CHECKING:
    from services.mavlink.adapter import Adapter

EXACT = 1e7  # whole numbers of MISSION_ITEM_INT to a degree


@handles("MISSION_COUNT")
def count(adapter: "Adapter", client: Client, m: Any) -> None:
    """An upload begins."""
    if adapter.trusts(client):
        adapter.missions.begin(client, m.mission_type, m.count)
    else:
        _refuse(client, m.mission_type, mavlink.MAV_MISSION_DENIED)


@handles("MISSION_ITEM_INT")
def item_int(adapter: "Adapter", client: Client, m: Any) -> None:
    """An item of an upload."""
    adapter.missions.take(client, m)


@handles("MISSION_ITEM")
def item(adapter: "Adapter", client: Client, m: Any) -> None:
    """The same with coordinates as floats."""
    if not (abs(m.x) <= 180.0 and abs(m.y) <= 180.0):
        _refuse(client, m.mission_type, mavlink.MAV_MISSION_INVALID)
        adapter.missions.cancel(client, m.mission_type)
        return
    fields = m.frame, m.command, m.current, m.autocontinue, m.param1, m.param2, m.param3, m.param4
    place = round(m.x * EXACT), round(m.y * EXACT), m.z
    exact = mavlink.MAVLink_mission_item_int_message(
        m.target_system, m.target_component, m.seq, *fields, *place, m.mission_type
    )
    adapter.missions.take(client, exact)


@handles("MISSION_REQUEST_LIST")
def request_list(adapter: "Adapter", client: Client, m: Any) -> None:
    """A download begins."""
    held = adapter.missions.held.get(m.mission_type)
    if held is None:
        _refuse(client, m.mission_type, mavlink.MAV_MISSION_UNSUPPORTED)
    else:
        client.send(mavlink.MAVLink_mission_count_message(client.system, client.component, len(held), m.mission_type))


@handles("MISSION_REQUEST_INT", "MISSION_REQUEST")
def request_item(adapter: "Adapter", client: Client, m: Any) -> None:
    """One item of a download, as often as it is asked for."""
    held = adapter.missions.held.get(m.mission_type, [])
    if m.seq >= len(held):
        _refuse(client, m.mission_type, mavlink.MAV_MISSION_INVALID_SEQUENCE)
        return
    i = held[m.seq]
    fields = i.command, int(adapter.vehicle.status.mission_current == m.seq), i.autocontinue
    params = i.param1, i.param2, i.param3, i.param4
    to = client.system, client.component, m.seq, i.frame
    if m.get_type() == "MISSION_REQUEST_INT":
        reply = mavlink.MAVLink_mission_item_int_message(*to, *fields, *params, i.x, i.y, i.z, m.mission_type)
    else:
        place = i.x / EXACT, i.y / EXACT, i.z
        reply = mavlink.MAVLink_mission_item_message(*to, *fields, *params, *place, m.mission_type)
    client.send(reply)


@handles("MISSION_ACK")
def acknowledged(adapter: "Adapter", client: Client, m: Any) -> None:
    """A download is complete, or an upload is given up."""
    adapter.missions.cancel(client, m.mission_type)


@handles("MISSION_CLEAR_ALL")
def clear(adapter: "Adapter", client: Client, m: Any) -> None:
    """Forget a mission, a fence, the rally points, or all of them."""
    if adapter.trusts(client):
        adapter.missions.clear(client, m.mission_type)
    else:
        _refuse(client, m.mission_type, mavlink.MAV_MISSION_DENIED)


@handles("MISSION_SET_CURRENT")
def set_current(adapter: "Adapter", client: Client, m: Any) -> None:
    """Go on with another item; MISSION_CURRENT says when that is so."""
    if adapter.trusts(client):
        adapter.requests.ask("mission_current", client.name, None, (m.seq,))


def _refuse(client: Client, kind: int, result: int) -> None:
    client.send(mavlink.MAVLink_mission_ack_message(client.system, client.component, result, kind))
