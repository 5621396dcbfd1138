"""The parameter protocol's messages."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.session import Session


def _is_addressed(session: Session, m: Any) -> bool:
    """Return True unless the message is for all systems: PX4 ignores those. Count them."""
    if m.target_system or session.vehicle.firmware.AUTOPILOT != mavlink.MAV_AUTOPILOT_PX4:
        return True
    session.count("parameter message for all systems")
    return False


@handles("PARAM_REQUEST_LIST")
def request_list(session: Session, m: Any) -> None:
    """Send all parameters, a few at a time."""
    if _is_addressed(session, m):
        session.parameters.start_list(session.endpoint)


@handles("PARAM_REQUEST_READ")
def request_read(session: Session, m: Any) -> None:
    """Send one parameter, by its name or its index."""
    if _is_addressed(session, m):
        session.parameters.read(session.endpoint, m.param_id, m.param_index)


@handles("PARAM_SET")
def set_(session: Session, m: Any) -> None:
    """Request another value of a parameter from the autopilot."""
    if _is_addressed(session, m):
        session.parameters.set(session.endpoint, m.param_id, m.param_value, m.param_type, session.trusted)
