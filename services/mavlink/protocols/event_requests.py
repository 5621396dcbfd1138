"""Requests of lost events and of a report of the arming checks."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols.commands import ACCEPTED, UNSUPPORTED, Command, Outcome, rule
from lapwing.services.mavlink.protocols.handler import handles
from lapwing.services.mavlink.session import Session


@handles("REQUEST_EVENT")
def request_events(session: Session, m: Any) -> None:
    """Send events again; allowed for every endpoint, like all telemetry."""
    for message in session.vehicle.events.replies(m.first_sequence, m.last_sequence, session.address):
        session.send(message)


@rule(mavlink.MAV_CMD_RUN_PREARM_CHECKS, changes=False)
def report(session: Session, c: Command) -> Outcome:
    """Request a report of the arming checks, which is sent with the next status."""
    if not session.vehicle.firmware.EVENTS:
        return UNSUPPORTED
    session.vehicle.report_requests += 1
    return ACCEPTED
