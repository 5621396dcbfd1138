"""Heartbeat, time synchronisation and origin."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.session import Session
from lapwing.services.mavlink.telemetry import answer_request


@handles("HEARTBEAT")
def heartbeat(session: Session, m: Any) -> None:
    """Record a heartbeat; select the stream rates of a companion computer."""
    session.vehicle.report_requests += session.endpoint.last_heartbeat is None
    session.endpoint.last_heartbeat = session.clock.now
    session.schedule.set_onboard(m.type == mavlink.MAV_TYPE_ONBOARD_CONTROLLER)


@handles("TIMESYNC")
def timesync(session: Session, m: Any) -> None:
    """Reply with both clocks; ignore replies."""
    if m.tc1 == 0:
        session.send(mavlink.MAVLink_timesync_message(session.vehicle.time_ns, m.ts1))


@handles("PING")
def ping(session: Session, m: Any) -> None:
    """Send a ping back, addressed to its sender."""
    if m.target_system == 0 and m.target_component == 0:
        session.send(mavlink.MAVLink_ping_message(m.time_usec, m.seq, *session.address))


@handles("SET_GPS_GLOBAL_ORIGIN")
def set_origin(session: Session, m: Any) -> None:
    """Echo the origin as received; the scene's home does not change."""
    if session.trusted:
        session.vehicle.origin = m.latitude, m.longitude, m.altitude
        for message in answer_request(session.vehicle, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN) or ():
            session.send(message)


@handles("SYSTEM_TIME", "COMMAND_ACK", "STATUSTEXT", "PARAM_VALUE", "REQUEST_DATA_STREAM", "RADIO_STATUS")
def ignore(session: Session, m: Any) -> None:
    """Ignore the message: the vehicle keeps its own time and, like PX4, has no data streams of that kind."""
