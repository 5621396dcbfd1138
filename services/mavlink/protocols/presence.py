"""Who is there, and what time it is."""

from typing import TYPE_CHECKING, Any

from services.mavlink.client import Client
from services.mavlink.dialect import mavlink
from services.mavlink.protocols.handler import handles

if TYPE_CHECKING:
    from services.mavlink.adapter import Adapter


@handles("HEARTBEAT")
def heartbeat(adapter: "Adapter", client: Client, m: Any) -> None:
    """A partner is there."""
    client.introduce(adapter.vehicle, m.type, adapter.clock.now)


@handles("TIMESYNC")
def timesync(adapter: "Adapter", client: Client, m: Any) -> None:
    """Answer with our clock beside theirs; their answers to us are of no use here."""
    if m.tc1 == 0:
        client.send(mavlink.MAVLink_timesync_message(adapter.vehicle.time_ns, m.ts1))


@handles("PING")
def ping(adapter: "Adapter", client: Client, m: Any) -> None:
    """Send a ping back, addressed to whoever asked."""
    if m.target_system == 0 and m.target_component == 0:
        client.send(mavlink.MAVLink_ping_message(m.time_usec, m.seq, client.system, client.component))


@handles("SET_GPS_GLOBAL_ORIGIN")
def set_origin(adapter: "Adapter", client: Client, m: Any) -> None:
    """Echo the origin exactly as given: the scene's home stays where it is."""
    if adapter.trusts(client):
        adapter.vehicle.origin = m.latitude, m.longitude, m.altitude
        adapter.send_all("GPS_GLOBAL_ORIGIN")


@handles("SYSTEM_TIME", "COMMAND_ACK", "STATUSTEXT", "PARAM_VALUE", "REQUEST_DATA_STREAM", "RADIO_STATUS")
def hear(adapter: "Adapter", client: Client, m: Any) -> None:
    """Heard, and nothing to be done: a vehicle keeps its own time, and PX4 too has no data streams of that kind."""
