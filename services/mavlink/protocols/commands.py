"""COMMAND_LONG and COMMAND_INT: a rule for each command, and acknowledgements with progress."""

from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import degrees
from lapwing.services.mavlink.protocols import handles
from lapwing.services.mavlink.session import Session

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
UNSUPPORTED, IN_PROGRESS = mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_IN_PROGRESS
NO_PROGRESS = 255


class Command(NamedTuple):
    """Command of a COMMAND_LONG or COMMAND_INT."""

    number: int  # MAV_CMD
    params: tuple[float, ...]  # parameters 1 to 4
    frame: int
    latitude: float  # [deg], or another meaning of parameter 5
    longitude: float
    altitude: float  # [m]


class Request(NamedTuple):
    """Command for the autopilot."""

    kind: str
    values: tuple[float, ...] = ()


class Reply(NamedTuple):
    """Accepted command with messages that follow the acknowledgement."""

    messages: list[Any]


class DeniedError(Exception):
    """Refusal of a command for a reason other than invalid parameters; its text is for the operator."""


Outcome = Request | Reply | int  # int: MAV_RESULT
Rule = Callable[[Session, Command], Outcome]

RULES: dict[int, Rule] = {}
"""Rule of each MAV_CMD; it returns a request to the autopilot, a reply, or a MAV_RESULT."""
READ_ONLY: set[int] = set()
"""Commands that change nothing, accepted from every endpoint."""


def rule(*numbers: int, changes: bool = True) -> Callable[[Rule], Rule]:
    """Declare the function that handles these commands."""

    def declare(function: Rule) -> Rule:
        RULES.update(dict.fromkeys(numbers, function))
        if not changes:
            READ_ONLY.update(numbers)
        return function

    return declare


@handles("COMMAND_LONG")
def command_long(session: Session, m: Any) -> None:
    """Handle COMMAND_LONG: seven numbers; positions in degrees, altitude above sea level."""
    p = (m.param1, m.param2, m.param3, m.param4)
    command = Command(m.command, p, mavlink.MAV_FRAME_GLOBAL, m.param5, m.param6, m.param7)
    execute(session, command)


@handles("COMMAND_INT")
def command_int(session: Session, m: Any) -> None:
    """Handle COMMAND_INT: four numbers and a position in a frame."""
    p = (m.param1, m.param2, m.param3, m.param4)
    execute(session, Command(m.command, p, m.frame, degrees(m.x), degrees(m.y), m.z))


def execute(session: Session, command: Command) -> None:
    """Execute a command and acknowledge it."""
    function = RULES.get(command.number)
    if function is None:
        outcome: Outcome = UNSUPPORTED
        session.count("unsupported command")
    elif command.number not in READ_ONLY and not session.trusted:
        outcome = DENIED
        if session.endpoint.last_heartbeat is None:
            session.send_text("command rejected: send a HEARTBEAT first")
    else:
        reason = ""
        try:
            outcome = function(session, command)
        except DeniedError as error:
            outcome, reason = DENIED, str(error)
        except (ValueError, OverflowError):  # an invalid position, a non-finite number
            outcome = DENIED
            session.count("invalid command")
        if outcome == DENIED and command.number not in READ_ONLY:
            name = mavlink.enums["MAV_CMD"][command.number].name.removeprefix("MAV_CMD_")
            session.send_text(reason or f"{name}: denied, invalid parameters")

    def acknowledge(result: int, progress: int = NO_PROGRESS) -> None:
        session.send(mavlink.MAVLink_command_ack_message(command.number, result, progress, 0, *session.address))

    def on_acknowledgement(acknowledgement: Any) -> None:
        progress = round(100.0 * acknowledgement.progress) if acknowledgement.result == IN_PROGRESS else NO_PROGRESS
        acknowledge(acknowledgement.result, progress)

    if isinstance(outcome, Request):
        session.command(outcome.kind, outcome.values, on_acknowledgement)
    elif isinstance(outcome, Reply):
        acknowledge(ACCEPTED)
        for message in outcome.messages:
            session.send(message)
    else:
        acknowledge(outcome)
