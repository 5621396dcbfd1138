"""Requests of message intervals, single messages, lost events, and a report of the arming checks."""

import math
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink, message_class
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.protocols.commands import ACCEPTED, DENIED, UNSUPPORTED, Command, Outcome, Reply, rule
from lapwing.services.mavlink.session import Session
from lapwing.services.mavlink.telemetry import answer_request, streams


@rule(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, changes=False)
def set_message_interval(session: Session, c: Command) -> Outcome:
    """Set the rate of a message to this endpoint."""
    number = int(c.params[0])
    if number not in streams() or math.isnan(c.params[1]):
        return UNSUPPORTED
    session.schedule.set_interval(number, c.params[1])
    return ACCEPTED


@rule(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, changes=False)
def get_message_interval(session: Session, c: Command) -> Outcome:
    """Send the interval of a message."""
    number = int(c.params[0])
    if not 0 <= number <= 0xFFFF:
        return DENIED
    interval = session.schedule.interval_us(number) if number in streams() else 0
    session.send(mavlink.MAVLink_message_interval_message(number, interval))
    return ACCEPTED


@rule(mavlink.MAV_CMD_REQUEST_MESSAGE, changes=False)
def request_message(session: Session, c: Command) -> Outcome:
    """Send a message once."""
    return _reply(session, int(c.params[0]), c.params[1])


@rule(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, changes=False)
def request_capabilities(session: Session, c: Command) -> Outcome:
    """Send AUTOPILOT_VERSION; the deprecated request."""
    return _reply(session, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)


@rule(mavlink.MAV_CMD_REQUEST_PROTOCOL_VERSION, changes=False)
def request_protocol_version(session: Session, c: Command) -> Outcome:
    """Send PROTOCOL_VERSION; the deprecated request."""
    return _reply(session, message_class("PROTOCOL_VERSION").id)


@rule(mavlink.MAV_CMD_GET_HOME_POSITION, changes=False)
def get_home_position(session: Session, c: Command) -> Outcome:
    """Send HOME_POSITION; the deprecated request."""
    return _reply(session, mavlink.MAVLINK_MSG_ID_HOME_POSITION)


def _reply(session: Session, number: int, parameter: float = 0.0) -> Outcome:
    messages = answer_request(session.vehicle, number, parameter)
    if messages is None:
        return UNSUPPORTED
    return Reply(messages) if messages else mavlink.MAV_RESULT_TEMPORARILY_REJECTED


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
