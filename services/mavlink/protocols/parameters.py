"""The parameter protocol's messages."""

from typing import Any

from lapwing.services.mavlink.protocols.handler import handles
from lapwing.services.mavlink.session import Session


@handles("PARAM_REQUEST_LIST")
def request_list(session: Session, m: Any) -> None:
    """Send all parameters, a few at a time."""
    session.parameters.start_list(session.endpoint)


@handles("PARAM_REQUEST_READ")
def request_read(session: Session, m: Any) -> None:
    """Send one parameter, by its name or its index."""
    session.parameters.read(session.endpoint, m.param_id, m.param_index)


@handles("PARAM_SET")
def set_(session: Session, m: Any) -> None:
    """Request another value of a parameter from the autopilot."""
    session.parameters.set(session.endpoint, m.param_id, m.param_value, m.param_type, session.trusted)
