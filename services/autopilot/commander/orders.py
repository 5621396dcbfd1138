"""The operator's commands: what each kind does. A refusal is a ValueError (one line), answered and spoken."""

import math
from collections.abc import Callable
from typing import Any

from messages import Answer
from services.autopilot.commander import checks
from services.autopilot.commander.fence import Fence, rally_points
from services.autopilot.commander.modes import modes
from services.autopilot.commander.modes.base import value
from services.autopilot.commander.pilot import Pilot
from services.autopilot.commander.route import Route

Order = Callable[[Pilot, Any], None]
ORDERS: dict[str, Order] = {}
"""What is done for each kind of command; flight modes besides these are entered by their names."""
SILENT = ("manual", "link", "offboard_position", "offboard_attitude")  # streams: not answered


class Denied(ValueError):
    """Refused for good: the command makes no sense, now or later."""


def order(*kinds: str) -> Callable[[Order], Order]:
    """Declare what commands of these kinds do."""

    def declare(function: Order) -> Order:
        ORDERS.update(dict.fromkeys(kinds, function))
        return function

    return declare


def obey(pilot: Pilot, command: Any) -> None:
    """Do what a command asks, and answer it."""
    function = ORDERS.get(command.kind)
    if function is None:
        pilot.answer(command, Answer.UNSUPPORTED, f"unknown command {command.kind} {command.text}".strip())
        return
    try:
        function(pilot, command)
    except ValueError as error:
        result = Answer.DENIED if isinstance(error, Denied) else Answer.TEMPORARILY_REJECTED
        if command.kind not in SILENT:
            pilot.answer(command, result, str(error), _now(pilot, command))
            pilot.say(str(error))
        return
    waits = pilot.waiting_arm is not None and pilot.waiting_arm[0] is command
    if command.kind not in SILENT and not waits:
        pilot.answer(command, Answer.ACCEPTED, "", _now(pilot, command))


def _now(pilot: Pilot, command: Any) -> float:
    return pilot.parameters.get(command.text, math.nan) if command.kind == "parameter" else 0.0


@order("arm")
def arm(pilot: Pilot, command: Any) -> None:
    """Values: 1 to arm whatever the checks say; how long [s] to wait for them."""
    if pilot.armed:
        return
    if reasons := checks.reasons(pilot):
        patience = value(command.values, 1)
        if patience > 0.0:
            pilot.waiting_arm = command, patience
            pilot.answer(command, Answer.IN_PROGRESS, reasons[0])
            return
        if value(command.values, 0) != 1.0 or pilot.estimate is None:
            raise ValueError(f"arming refused: {'; '.join(reasons)}")
    pilot.arm()


@order("disarm")
def disarm(pilot: Pilot, command: Any) -> None:
    """Values: 1 to disarm also in the air."""
    if not pilot.armed:
        return
    if pilot.flying and value(command.values, 0) != 1.0:
        raise ValueError("disarming refused: the vehicle flies")
    if pilot.on_trajectory:
        pilot.enter("hold")
    pilot.disarm("as commanded")


@order(*modes())
def change_mode(pilot: Pilot, command: Any) -> None:
    """Enter the flight mode of this name."""
    kind = modes()[command.kind].Mode
    if pilot.position_lost and pilot.flying and kind.needs_position:
        raise ValueError(f"{command.kind}: the position is lost")
    pilot.enter(command.kind, *command.values)
    pilot.failsafe = ""


@order("manual")
def manual(pilot: Pilot, command: Any) -> None:
    """Sticks, which the modes position_control and altitude_control listen to."""
    sticks = [max(-1.0, min(1.0, value(command.values, k))) for k in range(4)]
    pilot.sticks, pilot.sticks_age = tuple(0.0 if math.isnan(v) else v for v in sticks), 0.0


@order("offboard_position", "offboard_attitude")
def offboard(pilot: Pilot, command: Any) -> None:
    """A setpoint; the mode offboard is accepted only while they come."""
    if any(math.isinf(v) for v in command.values):
        raise Denied("offboard: expected finite setpoints")
    pilot.offboard, pilot.offboard_age = (command.kind, command.values), 0.0


@order("link")
def link(pilot: Pilot, command: Any) -> None:
    """A ground station is there."""
    pilot.linked, pilot.link_age = True, 0.0


@order("mission_upload")
def mission_upload(pilot: Pilot, command: Any) -> None:
    """A new mission, in place of the one there is."""
    pilot.route = _sound(Route, command.items)
    if pilot.mode_name == "mission" and not pilot.on_trajectory:
        pilot.enter("mission" if pilot.route.items and pilot.flying else "hold")


@order("mission_clear")
def mission_clear(pilot: Pilot, command: Any) -> None:
    """No mission any more."""
    pilot.route = Route()
    if pilot.mode_name == "mission" and not pilot.on_trajectory:
        pilot.enter("hold")


@order("mission_current")
def mission_current(pilot: Pilot, command: Any) -> None:
    """Go on with another item."""
    number = value(command.values, 0)
    _sound(pilot.route.select, int(number) if math.isfinite(number) else -1)


@order("fence_upload")
def fence_upload(pilot: Pilot, command: Any) -> None:
    """A new fence; without items, none."""
    pilot.fence = _sound(Fence, command.items)


@order("rally_upload")
def rally_upload(pilot: Pilot, command: Any) -> None:
    """New places to return to; without items, home."""
    pilot.rally = _sound(rally_points, command.items)


@order("speed")
def speed(pilot: Pilot, command: Any) -> None:
    """Fly at another speed [m/s] until disarmed."""
    asked = value(command.values, 0)
    if not 0.0 < asked < math.inf:
        raise Denied(f"speed: expected one above 0 m/s, got {asked:g}")
    pilot.speed = asked


@order("parameter")
def parameter(pilot: Pilot, command: Any) -> None:
    """Change a parameter; the flying autopilot follows at once."""
    known = pilot.table.get(command.text)
    if known is None:
        raise Denied(f"unknown parameter {command.text}")
    asked = value(command.values, 0)
    _sound(known.check, asked)
    pilot.parameters[known.name] = asked
    pilot.parameters_changed = True


@order("finish")
def finish(pilot: Pilot, command: Any) -> None:
    """The run is over once the vehicle has flown and is disarmed."""
    pilot.last_flight = True


def _sound(function: Callable, argument: Any) -> Any:
    """The function's value; what it refuses is refused for good."""
    try:
        return function(argument)
    except ValueError as error:
        raise Denied(str(error)) from None
