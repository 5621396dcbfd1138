"""Handlers of operator commands. A ValueError (one line) rejects a command with an acknowledgement and status text."""

import math
from collections.abc import Callable
from typing import Any

from lapwing.messages import CommandAck
from lapwing.services.autopilot.commander import prearm_checks, transitions
from lapwing.services.autopilot.commander.commander_state import PendingArm
from lapwing.services.autopilot.commander.flight_mode import value
from lapwing.services.autopilot.commander.mode_table import MODES
from lapwing.services.autopilot.commander.transitions import Context
from lapwing.services.common import status_texts
from lapwing.services.common.failure_types import SATELLITES, with_satellites

Handler = Callable[[Context, Any], None]
HANDLERS: dict[str, Handler] = {}
"""Handler by kind of command."""
STREAMS = ("manual", "link", "offboard_position", "offboard_attitude", "offboard_motors")  # not acknowledged


class Denied(ValueError):
    """Permanent rejection of an invalid command."""


def handles(*kinds: str) -> Callable[[Handler], Handler]:
    """Register the handler of these kinds of commands."""

    def register(function: Handler) -> Handler:
        HANDLERS.update(dict.fromkeys(kinds, function))
        return function

    return register


def handle(context: Context, command: Any) -> None:
    """Execute a command and acknowledge it."""
    outbox = context.outbox
    handler = HANDLERS.get(command.kind)
    if handler is None:
        outbox.acknowledge(command, CommandAck.UNSUPPORTED, f"unknown command {command.kind} {command.text}".strip())
        return
    try:
        handler(context, command)
    except ValueError as error:
        result = CommandAck.DENIED if isinstance(error, Denied) else CommandAck.TEMPORARILY_REJECTED
        if command.kind not in STREAMS:
            outbox.acknowledge(command, result, str(error), _present_value(context, command))
            outbox.send_text(str(error))
        return
    pending = context.state.pending_arm
    is_pending = pending is not None and pending.command is command
    if command.kind not in STREAMS and not is_pending:
        outbox.acknowledge(command, CommandAck.ACCEPTED, "", _present_value(context, command))


def _present_value(context: Context, command: Any) -> float:
    return context.state.guidance.parameters.get(command.text, math.nan) if command.kind == "parameter" else 0.0


@handles("arm")
def arm(context: Context, command: Any) -> None:
    """Arm. Values: 1 to skip the pre-arm checks; time [s] to wait for them."""
    if context.state.guidance.armed:
        return
    if blockers := prearm_checks.arming_blockers(context.view, context.state):
        time_left = value(command.values, 1)
        if time_left > 0.0:
            context.state.pending_arm = PendingArm(command, time_left)
            context.outbox.acknowledge(command, CommandAck.IN_PROGRESS, blockers[0])
            return
        if value(command.values, 0) != 1.0:
            raise ValueError(f"Arming denied: {'; '.join(blockers)}")
    transitions.arm(context)


@handles("disarm")
def disarm(context: Context, command: Any) -> None:
    """Disarm. Values: 1 to allow it in the air."""
    state = context.state
    if not state.guidance.armed:
        return
    in_flight = state.guidance.flying
    if in_flight and value(command.values, 0) != 1.0:
        raise ValueError("Disarming denied: not landed")  # the words of PX4
    if state.on_trajectory:
        transitions.enter(context.constants, state, "hold")
    transitions.disarm(context, status_texts.STOPPED if in_flight else status_texts.AS_COMMANDED)


@handles(*MODES)
def change_mode(context: Context, command: Any) -> None:
    """Enter the flight mode of this name."""
    state = context.state
    if context.view.position_lost and state.guidance.flying and MODES[command.kind].needs_position:
        raise ValueError(f"{command.kind}: the position is lost")
    transitions.enter(context.constants, state, command.kind, *command.values)
    state.failsafe = ""


@handles("mission_start")
def mission_start(context: Context, command: Any) -> None:
    """Arm and fly the mission from an item, as PX4 does at MAV_CMD_MISSION_START."""
    before = context.state.mode, context.state.mode_name
    transitions.enter(context.constants, context.state, "mission", *command.values[:1])
    if not context.state.guidance.armed and (blockers := prearm_checks.arming_blockers(context.view, context.state)):
        context.state.mode, context.state.mode_name = before
        raise ValueError(f"Arming denied: {'; '.join(blockers)}")
    if not context.state.guidance.armed:
        transitions.arm(context)
    context.state.failsafe = ""


@handles("manual")
def manual(context: Context, command: Any) -> None:
    """Store the sticks of the manual modes."""
    if not context.state.guidance.uses_sticks:
        return
    sticks = [max(-1.0, min(1.0, value(command.values, k))) for k in range(4)]
    inputs = context.state.guidance.inputs
    inputs.sticks, inputs.sticks_age = tuple(0.0 if math.isnan(v) else v for v in sticks), 0.0


@handles("offboard_position", "offboard_attitude", "offboard_motors")
def offboard(context: Context, command: Any) -> None:
    """Store an offboard setpoint, or the voltage of each motor [V]."""
    inputs, motors = context.state.guidance.inputs, context.constants.rotors
    inputs.offboard_rejection = ""
    if any(math.isinf(v) for v in command.values):
        inputs.offboard_rejection = "expected finite setpoints"
    elif command.kind == "offboard_motors" and (len(command.values) != motors or any(map(math.isnan, command.values))):
        inputs.offboard_rejection = f"expected {motors} voltages, got {list(command.values)}"
    if inputs.offboard_rejection:
        raise Denied(f"offboard: {inputs.offboard_rejection}")
    inputs.offboard_kind, inputs.offboard, inputs.offboard_age = command.kind, command.values, 0.0


@handles("link")
def link(context: Context, command: Any) -> None:
    """Record the heartbeat of a ground station."""
    inputs = context.state.guidance.inputs
    inputs.linked, inputs.link_age = True, 0.0


@handles("speed")
def speed(context: Context, command: Any) -> None:
    """Change the speed [m/s] until disarmed; NaN: the parameter's."""
    requested = value(command.values, 0)
    if not (0.0 < requested < math.inf or math.isnan(requested)):
        raise Denied(f"speed: expected a speed above 0 m/s, got {requested:g}")
    context.state.guidance.speed = requested


@handles("parameter")
def parameter(context: Context, command: Any) -> None:
    """Change a parameter, effective at once."""
    definition = context.constants.parameters.get(command.text)
    if definition is None:
        raise Denied(f"unknown parameter {command.text}")
    requested = value(command.values, 0)
    call_or_deny(definition.check, requested)
    parameters = context.state.guidance.parameters
    parameters[definition.name] = requested
    context.outbox.parameters = dict(parameters)
    if definition.name == SATELLITES:
        context.outbox.faults = with_satellites(context.state.faults, parameters, context.constants.has_gps)


@handles("finish")
def finish(context: Context, command: Any) -> None:
    """End the run once the vehicle has flown and is disarmed."""
    context.state.guidance.finish_requested = True


def call_or_deny(function: Callable, argument: Any) -> Any:
    """Return the function's value. Raise Denied instead of its ValueError."""
    try:
        return function(argument)
    except ValueError as error:
        raise Denied(str(error)) from None
