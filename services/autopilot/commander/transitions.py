"""State transitions: change of mode, arming, disarming."""

import math
from typing import NamedTuple

from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.commander_output import OperatorMessages
from lapwing.services.autopilot.commander.commander_state import State
from lapwing.services.autopilot.commander.mode_table import MODES
from lapwing.services.common import status_texts

LONGEST_FALL = 30.0  # [s] after the motors stopped in flight: the estimate of a crashed vehicle may not come to rest


class Context(NamedTuple):
    """Data of one tick for command handlers and failsafes."""

    constants: Constants
    view: CommanderInput
    state: State
    outbox: OperatorMessages


def enter(constants: Constants, state: State, name: str, *values: float) -> None:
    """Enter a mode.

    Raises:
        ValueError: the mode cannot be entered.
    """
    kind = MODES[name]
    if kind.needs_flight and not state.guidance.flying:
        raise ValueError(f"{name}: the vehicle does not fly")
    mode = kind(constants, state.guidance, *values)
    if state.mode_name == "mission" != name:
        state.guidance.speed = math.nan  # a mission's speed ends with it
    state.mode, state.mode_name = mode, name


def arm(context: Context) -> None:
    """Arm and set home."""
    guidance = context.state.guidance
    guidance.armed, guidance.has_flown, context.state.on_ground_time = True, False, 0.0
    context.state.failsafe, context.state.fall_time = "", math.inf
    if not guidance.sticks_fresh:
        guidance.inputs.sticks_age = math.inf  # lost at arming: optional until they return, as in PX4
    x, y, z = context.view.estimate.position_world
    guidance.home = (x, y, z - context.constants.resting_height)
    context.outbox.send_text(status_texts.ARMED)


def disarm(context: Context, reason: str) -> None:
    """Disarm and reset the flight's settings. In flight, the reason stays the status' failsafe until the next one."""
    state = context.state
    in_flight = state.guidance.flying
    state.failsafe, state.fall_time = (reason, LONGEST_FALL) if in_flight else ("", math.inf)
    state.guidance.armed = state.guidance.flying = False
    state.guidance.speed, state.guidance.roi = math.nan, None
    state.failsafe_timers.clear()
    if state.mode_name != "hold":
        enter(context.constants, state, "hold")
    context.outbox.send_text(status_texts.DISARMED.format(reason))
