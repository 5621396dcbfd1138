"""Failsafes: hold, return, land, descend or terminate after a loss, by parameters."""

from collections.abc import Callable
from typing import NamedTuple

from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_state import FailsafeTimer, State
from lapwing.services.autopilot.commander.guidance import TOO_FAR, TOO_HIGH
from lapwing.services.autopilot.commander.transitions import Context, disarm, enter
from lapwing.services.common import status_texts
from lapwing.services.common.autopilot_parameters import DESCEND, HOLD, LAND, RETURN, TERMINATE
from lapwing.services.common.plans.fence import INSIDE, OUTSIDE

_MODES = {HOLD: "hold", RETURN: "return", LAND: "land", DESCEND: "descend", TERMINATE: "terminate"}
_SEVERITY = ("hold", "return", "land", "descend")  # a failsafe never replaces a more severe one
_MANUAL = ("position_control", "altitude_control", "stabilized", "acro")
_EXEMPTION = {"mission": 1, "offboard": 4} | dict.fromkeys(_MANUAL, 0)  # bit of COM_RCL_EXCEPT by mode
_AUTO = 2  # bit of the other modes
_WARNING_TIME = 1.0  # [s] from the start of a condition to the operator's warning


class Failsafe(NamedTuple):
    """A condition, its delay, and the parameter of its action."""

    reason: str
    is_active: Callable[[Context], bool]
    delay: Callable[[dict[str, float]], float]  # [s] by the parameters
    action: str  # parameter


def _battery(reason: str, threshold: str, action: str) -> Failsafe:
    return Failsafe(
        reason, lambda c: c.view.battery_charge < c.state.guidance.parameters[threshold], lambda p: 0.5, action
    )


def _link_lost(context: Context) -> bool:
    guidance = context.state.guidance
    return guidance.inputs.linked and guidance.inputs.link_age > guidance.parameters["COM_DL_LOSS_T"]


def _sticks_lost(context: Context) -> bool:
    """Return True if sticks moved by a pilot since arming are lost, as in PX4 unless the mode is exempt.

    Without a position the manual modes change to descend.
    """
    guidance, parameters = context.state.guidance, context.state.guidance.parameters
    if "NAV_RCL_ACT" not in parameters:  # in logs of former versions
        return False
    used = guidance.uses_sticks and math.isfinite(guidance.inputs.sticks_age)
    if not used or guidance.sticks_fresh or context.view.position_lost:
        return False
    return not _EXEMPTION.get(context.state.mode_name, _AUTO) & int(parameters["COM_RCL_EXCEPT"])


def _offboard_lost(context: Context) -> bool:
    return context.state.mode_name == "offboard" and not context.state.guidance.offboard_available


def _fence(reason: str, breach: str) -> Failsafe:
    def is_active(context: Context) -> bool:
        return context.state.guidance.breach(context.constants, context.view.estimate.position_world) == breach

    return Failsafe(reason, is_active, lambda p: 0.1, "FS_FENCE_ACT")


FAILSAFES = (
    Failsafe(
        status_texts.POSITION_LOST, lambda c: c.view.position_lost, lambda p: p["COM_POS_FS_DELAY"], "FS_ESTIMATE_ACT"
    ),
    Failsafe(status_texts.MOTOR_FAILED, lambda c: c.view.failed_motor > 0, lambda p: 0.0, "FS_MOTOR_ACT"),
    _battery(status_texts.BATTERY_EMPTY, "BAT_EMERGEN_THR", "FS_BAT_EMER_ACT"),
    _battery(status_texts.BATTERY_CRITICAL, "BAT_CRIT_THR", "FS_BAT_CRIT_ACT"),
    _battery(status_texts.BATTERY_LOW, "BAT_LOW_THR", "FS_BAT_LOW_ACT"),
    Failsafe(status_texts.LINK_LOST, _link_lost, lambda p: 0.0, "NAV_DLL_ACT"),
    Failsafe(status_texts.STICKS_LOST, _sticks_lost, lambda p: 0.0, "NAV_RCL_ACT"),
    Failsafe(status_texts.SETPOINTS_LOST, _offboard_lost, lambda p: 0.0, "FS_OFFBOARD_ACT"),
    _fence(status_texts.FENCE_LEFT, OUTSIDE),
    _fence(status_texts.KEEP_OUT_ENTERED, INSIDE),
    _fence(status_texts.TOO_FAR, TOO_FAR),
    _fence(status_texts.TOO_HIGH, TOO_HIGH),
)


def update(context: Context) -> None:
    """Act on conditions that have lasted for their delay, once until they end."""
    view, state, parameters = context.view, context.state, context.state.guidance.parameters
    for failsafe in FAILSAFES:
        if not failsafe.is_active(context):
            state.failsafe_timers.pop(failsafe.reason, None)
            continue
        before, acted = state.failsafe_timers.get(failsafe.reason, FailsafeTimer(0.0, False))
        elapsed = before + view.dt
        if not acted:
            delay, mode = failsafe.delay(parameters), _MODES.get(round(parameters[failsafe.action]))
            if elapsed > delay:
                acted = _act(context, failsafe.reason, mode)
            elif before <= _WARNING_TIME < elapsed and mode:
                context.outbox.send_text(f"{failsafe.reason}: {mode} in {delay - _WARNING_TIME:.0f} s")
        state.failsafe_timers[failsafe.reason] = FailsafeTimer(elapsed, acted)


def any_active(context: Context) -> bool:
    """Return True if a condition is active or a timer is running."""
    return bool(context.state.failsafe_timers) or any(failsafe.is_active(context) for failsafe in FAILSAFES)


def _act(context: Context, reason: str, mode: str | None) -> bool:
    """Take the action. Return True if the present mode allows it."""
    state = context.state
    if mode is None:
        context.outbox.send_text(reason)
        return True
    if mode == "terminate":
        if state.on_trajectory:
            enter(context.constants, state, "hold")
        disarm(context, reason)
        return True
    if mode == "descend" and state.guidance.sticks_fresh:
        mode = "altitude_control"  # a pilot holds the sticks
    elif _severity(state) >= _SEVERITY.index(mode):
        return False
    take_over(context, reason, mode)
    return True


def take_over(context: Context, reason: str, mode: str) -> None:
    """Enter the mode of a failsafe, and tell the operator why."""
    context.state.failsafe = reason
    enter(context.constants, context.state, mode)
    context.outbox.send_text(status_texts.TAKEN_OVER.format(reason, mode))


def _severity(state: State) -> int:
    return _SEVERITY.index(state.mode_name) if state.mode_name in _SEVERITY[1:] else -1
