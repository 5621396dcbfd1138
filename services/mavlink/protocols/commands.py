"""COMMAND_LONG, COMMAND_INT and SET_MODE: to the autopilot, with its answer and progress back to the client."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from dynamics.vector import Vec3
from services.mavlink.client import Client
from services.mavlink.dialect import mavlink
from services.mavlink.frames import swap_yaw
from services.mavlink.place import degrees, to_world
from services.mavlink.protocols.handler import handles

if TYPE_CHECKING:
    from services.mavlink.adapter import Adapter

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
UNSUPPORTED, IN_PROGRESS = mavlink.MAV_RESULT_UNSUPPORTED, mavlink.MAV_RESULT_IN_PROGRESS
NO_PROGRESS = 255


class Command(NamedTuple):
    """A command as either message spells it."""

    number: int  # MAV_CMD
    params: tuple[float, ...]  # the first four
    frame: int
    latitude: float  # [deg], or what else parameter 5 means
    longitude: float
    altitude: float  # [m]

    @property
    def position_world(self) -> Vec3:
        """Its place [m]; ValueError where that is none."""
        return to_world(self.frame, self.latitude, self.longitude, self.altitude)


class Ask(NamedTuple):
    """What the autopilot is to be asked."""

    kind: str
    values: tuple[float, ...] = ()


Rule = Callable[["Adapter", Client, Command], Ask | int]

RULES: dict[int, Rule] = {}
"""What becomes of each MAV_CMD: a question to the autopilot, or an answer (MAV_RESULT) at once."""
OPEN: set[int] = set()
"""Those that change nothing and that everybody may give."""


def rule(*numbers: int, changes: bool = True) -> Callable[[Rule], Rule]:
    """Declare what becomes of these commands."""

    def declare(function: Rule) -> Rule:
        RULES.update(dict.fromkeys(numbers, function))
        if not changes:
            OPEN.update(numbers)
        return function

    return declare


@handles("COMMAND_LONG")
def command_long(adapter: "Adapter", client: Client, m: Any) -> None:
    """Seven numbers; places in degrees above the sea."""
    p = (m.param1, m.param2, m.param3, m.param4)
    command = Command(m.command, p, mavlink.MAV_FRAME_GLOBAL, m.param5, m.param6, m.param7)
    execute(adapter, client, command)


@handles("COMMAND_INT")
def command_int(adapter: "Adapter", client: Client, m: Any) -> None:
    """Four numbers and an exact place in a frame of its own."""
    p = (m.param1, m.param2, m.param3, m.param4)
    execute(adapter, client, Command(m.command, p, m.frame, degrees(m.x), degrees(m.y), m.z))


def execute(adapter: "Adapter", client: Client, command: Command) -> None:
    """Do it, and acknowledge it."""
    function = RULES.get(command.number)
    if function is None:
        outcome: Ask | int = UNSUPPORTED
        adapter.counts["unsupported command"] += 1
    elif command.number not in OPEN and not adapter.trusts(client):
        outcome = DENIED
    else:
        try:
            outcome = function(adapter, client, command)
        except (ValueError, OverflowError):  # a place that is none, a number that is not finite
            outcome = DENIED
            adapter.counts["senseless command"] += 1
    to = client.system, client.component

    def acknowledge(result: int, progress: int = NO_PROGRESS) -> None:
        client.send(mavlink.MAVLink_command_ack_message(command.number, result, progress, 0, *to))

    def answered(answer: Any) -> None:
        progress = round(100.0 * answer.progress) if answer.result == IN_PROGRESS else NO_PROGRESS
        acknowledge(answer.result, progress)

    if isinstance(outcome, Ask):
        adapter.requests.ask(outcome.kind, client.name, answered, outcome.values)
    else:
        acknowledge(outcome)
        if command.number in _FOLLOWED and outcome == ACCEPTED:
            client.send(adapter.build(_FOLLOWED[command.number](command)))


@handles("SET_MODE")
def set_mode(adapter: "Adapter", client: Client, m: Any) -> None:
    """The old way to change the mode, which is not acknowledged."""
    kind = adapter.vehicle.flavour.mode_kind(m.custom_mode)
    if kind and adapter.trusts(client):
        adapter.requests.ask(kind, client.name)


@rule(mavlink.MAV_CMD_DO_SET_MODE)
def do_set_mode(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """A flight mode by its numbers."""
    flavour = adapter.vehicle.flavour
    if not int(c.params[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
        return UNSUPPORTED
    kind = flavour.mode_kind(flavour.custom_mode(c.params[1], c.params[2]))
    return Ask(kind) if kind else UNSUPPORTED


FORCED = (21196.0, 2989.0)  # PX4's and ArduPilot's word for: whatever the checks say


@rule(mavlink.MAV_CMD_COMPONENT_ARM_DISARM)
def arm_disarm(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Motors ready or off."""
    if c.params[0] not in (0.0, 1.0):
        return DENIED
    return Ask("arm" if c.params[0] else "disarm", (float(c.params[1] in FORCED),))


@rule(mavlink.MAV_CMD_NAV_TAKEOFF)
def takeoff(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Up to an altitude, above the sea or home as the flavour has it, or to the parameter's where none is given."""
    frame = c.frame if adapter.vehicle.flavour.TAKEOFF_ABOVE_SEA else mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    _, _, height = to_world(frame, math.nan, math.nan, c.altitude)
    return Ask("takeoff", (height, math.nan))


@rule(mavlink.MAV_CMD_NAV_LAND)
def land(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Down, where it is."""
    return Ask("land")


@rule(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
def return_(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Home."""
    return Ask("return")


@rule(mavlink.MAV_CMD_NAV_LOITER_UNLIM)
def loiter(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Stay here."""
    return Ask("hold")


@rule(mavlink.MAV_CMD_DO_PAUSE_CONTINUE)
def pause(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Stay here, or go on with the mission."""
    return Ask("mission", (math.nan,)) if c.params[0] == 1.0 else Ask("hold")


@rule(mavlink.MAV_CMD_DO_REPOSITION)
def reposition(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Go there; what of the place is not given stays as it is. Yaw is a heading [rad]."""
    motion = adapter.vehicle.motion
    there = c.position_world
    if motion is None or all(map(math.isnan, there)):
        return Ask("hold")
    place = [here if math.isnan(asked) else asked for here, asked in zip(motion.position_world, there, strict=True)]
    speed = c.params[0] if c.params[0] > 0.0 else math.nan
    return Ask("goto", (*place, swap_yaw(c.params[3]), speed))


@rule(mavlink.MAV_CMD_MISSION_START)
def mission_start(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Fly the mission from an item."""
    return Ask("mission", (c.params[0],))


@rule(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT)
def set_mission_current(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Go on with another item."""
    return Ask("mission_current", (c.params[0],)) if c.params[0] >= 0.0 else ACCEPTED


@rule(mavlink.MAV_CMD_DO_CHANGE_SPEED)
def change_speed(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Fly at another speed; one below 0 is none."""
    return Ask("speed", (c.params[1],)) if c.params[1] >= 0.0 else ACCEPTED


@rule(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, changes=False)
def set_message_interval(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """Another rate for one message, to this partner alone."""
    number = int(c.params[0])
    if not adapter.knows(number) or math.isnan(c.params[1]):
        return UNSUPPORTED
    client.ask_interval(adapter.vehicle, number, c.params[1])
    return ACCEPTED


@rule(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, changes=False)
def get_message_interval(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """How often a message is sent."""
    number = int(c.params[0])
    if not 0 <= number <= 0xFFFF:
        return DENIED
    interval = client.interval_us(number) if adapter.knows(number) else 0
    client.send(mavlink.MAVLink_message_interval_message(number, interval))
    return ACCEPTED


@rule(
    mavlink.MAV_CMD_REQUEST_MESSAGE,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    mavlink.MAV_CMD_GET_HOME_POSITION,
    changes=False,
)
def request_message(adapter: "Adapter", client: Client, c: Command) -> Ask | int:
    """One message, once, after the acknowledgement."""
    number = _FOLLOWED[c.number](c)
    if not adapter.knows(number):
        return UNSUPPORTED
    return ACCEPTED if adapter.build(number) is not None else mavlink.MAV_RESULT_TEMPORARILY_REJECTED


_FOLLOWED: dict[int, Callable[[Command], int]] = {
    mavlink.MAV_CMD_REQUEST_MESSAGE: lambda c: int(c.params[0]),
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: lambda c: mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
    mavlink.MAV_CMD_GET_HOME_POSITION: lambda c: mavlink.MAVLINK_MSG_ID_HOME_POSITION,
}
