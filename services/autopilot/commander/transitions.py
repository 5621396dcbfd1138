"""Changes of the state that commands, failsafes and time-outs share: another mode, armed, disarmed."""

import math
from typing import NamedTuple

from services.autopilot.commander.mode_table import MODES
from services.autopilot.commander.request import Outbox
from services.autopilot.commander.state import State
from services.autopilot.commander.view import Constants, View


class Context(NamedTuple):
    """One tick, as command handlers and failsafes work on it."""

    constants: Constants
    view: View
    state: State
    outbox: Outbox


def enter(constants: Constants, state: State, name: str, *values: float) -> None:
    """Go to another mode.

    Raises:
        ValueError: why that cannot be.
    """
    kind = MODES[name]
    if kind.needs_flight and not state.guidance.flying:
        raise ValueError(f"{name}: the vehicle does not fly")
    state.mode, state.mode_name = kind(constants, state.guidance, *values), name


def arm(context: Context) -> None:
    """Motors ready; home is here."""
    guidance = context.state.guidance
    guidance.armed, guidance.has_flown, context.state.on_ground_time = True, False, 0.0
    x, y, _ = context.view.estimate.position_world
    guidance.home = (x, y)
    context.outbox.say("armed")


def disarm(context: Context, reason: str) -> None:
    """Motors off, wherever it is."""
    state = context.state
    state.guidance.armed = state.guidance.flying = False
    state.failsafe, state.guidance.speed = "", math.nan
    state.failsafe_timers.clear()
    if state.mode_name != "hold":
        enter(context.constants, state, "hold")
    context.outbox.say(f"disarmed: {reason}")
