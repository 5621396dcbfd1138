"""Handlers of operator commands for missions, fences and positions."""

import math
from typing import Any

from lapwing.services.autopilot.commander import transitions
from lapwing.services.autopilot.commander.command_handlers import Denied, call_or_deny, handles
from lapwing.services.autopilot.commander.flight_mode import fill_in, value, vector
from lapwing.services.autopilot.commander.guidance import GRIPPER
from lapwing.services.autopilot.commander.route import GRAB, Route
from lapwing.services.autopilot.commander.transitions import Context
from lapwing.services.common.plans.fence import Fence, rally_points
from lapwing.services.common.plans.route_checks import check_first_place


@handles("mission_upload")
def mission_upload(context: Context, command: Any) -> None:
    """Replace the mission."""
    state, guidance = context.state, context.state.guidance
    start = guidance.home if guidance.armed else context.view.estimate.position_world
    route = call_or_deny(Route, command.items)
    call_or_deny(lambda items: check_first_place(items, start[:2], guidance.first_place_limit), command.items)
    guidance.route = route
    if state.mode_name == "mission" and not state.on_trajectory:
        continues = state.guidance.route.items and state.guidance.flying
        transitions.enter(context.constants, state, "mission" if continues else "hold")


@handles("mission_clear")
def mission_clear(context: Context, command: Any) -> None:
    """Delete the mission."""
    state = context.state
    state.guidance.route = Route()
    if state.mode_name == "mission" and not state.on_trajectory:
        transitions.enter(context.constants, state, "hold")


@handles("mission_current")
def mission_current(context: Context, command: Any) -> None:
    """Select the current item."""
    number = value(command.values, 0)
    call_or_deny(context.state.guidance.route.select, int(number) if math.isfinite(number) else -1)


@handles("fence_upload")
def fence_upload(context: Context, command: Any) -> None:
    """Replace the fence; without items, remove it."""
    context.state.guidance.fence = call_or_deny(Fence, command.items)


@handles("rally_upload")
def rally_upload(context: Context, command: Any) -> None:
    """Replace the rally points; without items, remove them."""
    context.state.guidance.rally_points = call_or_deny(rally_points, command.items)


@handles("set_home")
def set_home(context: Context, command: Any) -> None:
    """Set home. Values: x, y, z of the ground [m]; missing coordinates are those of the vehicle."""
    x, y, z = context.view.estimate.position_world
    home = fill_in((x, y, z - context.constants.resting_height), vector(command.values, 0))
    if not all(map(math.isfinite, home)):
        raise Denied("set home: expected a position")
    context.state.guidance.home = home


@handles("roi")
def region_of_interest(context: Context, command: Any) -> None:
    """Set the region of interest. Values: x, y, z [m]; without a position, clear it."""
    place = vector(command.values, 0)
    context.state.guidance.roi = place if all(map(math.isfinite, place[:2])) else None


@handles("gripper")
def gripper(context: Context, command: Any) -> None:
    """Open (0) or close (1) the gripper; a released payload does not return."""
    guidance = context.state.guidance
    if not guidance.has_gripper:
        raise ValueError(f"gripper: {GRIPPER} is 0; set it to 1 first")
    guidance.released = value(command.values, 0) != GRAB
