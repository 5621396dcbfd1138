"""Failsafes: hold, return, land or descend after a loss, by parameters."""

from collections.abc import Callable
from typing import NamedTuple

from lapwing.services.autopilot.commander.commander_input import CommanderInput
from lapwing.services.autopilot.commander.commander_state import FailsafeTimer, State
from lapwing.services.autopilot.commander.transitions import Context, enter
from lapwing.services.common import status_texts
from lapwing.services.common.autopilot_parameters import DESCEND, HOLD, LAND, RETURN

_MODES = {HOLD: "hold", RETURN: "return", LAND: "land", DESCEND: "descend"}
_SEVERITY = ("hold", "return", "land", "descend")  # a failsafe never replaces a more severe one
_WARNING_TIME = 1.0  # [s] of a condition before the operator is warned


class Failsafe(NamedTuple):
    """A condition, its delay, and the parameter of its action."""

    reason: str
    holds: Callable[[CommanderInput, State], bool]
    delay: Callable[[dict[str, float]], float]  # of the parameters [s]
    action: str  # parameter


def _battery(reason: str, threshold: str, action: str) -> Failsafe:
    return Failsafe(reason, lambda v, s: v.battery_charge < s.guidance.parameters[threshold], lambda p: 0.5, action)


def _link_lost(view: CommanderInput, state: State) -> bool:
    inputs = state.guidance.inputs
    return inputs.linked and inputs.link_age > state.guidance.parameters["COM_DL_LOSS_T"]


FAILSAFES = (
    Failsafe(
        status_texts.POSITION_LOST,
        lambda v, s: v.position_lost,
        lambda p: p["COM_POS_FS_DELAY"],
        "FS_ESTIMATE_ACT",
    ),
    Failsafe(status_texts.MOTOR_FAILED, lambda v, s: v.failed_motor > 0, lambda p: 0.0, "FS_MOTOR_ACT"),
    _battery(status_texts.BATTERY_EMPTY, "BAT_EMERGEN_THR", "FS_BAT_EMER_ACT"),
    _battery(status_texts.BATTERY_CRITICAL, "BAT_CRIT_THR", "FS_BAT_CRIT_ACT"),
    _battery(status_texts.BATTERY_LOW, "BAT_LOW_THR", "FS_BAT_LOW_ACT"),
    Failsafe(status_texts.LINK_LOST, _link_lost, lambda p: 0.0, "NAV_DLL_ACT"),
    Failsafe(
        status_texts.SETPOINTS_LOST,
        lambda v, s: s.mode_name == "offboard" and not s.guidance.offboard_available,
        lambda p: 0.0,
        "FS_OFFBOARD_ACT",
    ),
    Failsafe(
        status_texts.FENCE_LEFT,
        lambda v, s: not s.guidance.fence.allows(*v.estimate.position_world[:2]),
        lambda p: 0.1,
        "FS_FENCE_ACT",
    ),
)


def update(context: Context) -> None:
    """Act on conditions that have lasted for their delay, once until they end."""
    view, state, parameters = context.view, context.state, context.state.guidance.parameters
    for failsafe in FAILSAFES:
        if not failsafe.holds(view, state):
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


def any_holds(context: Context) -> bool:
    """Return True if a condition holds or a timer is running."""
    view, state = context.view, context.state
    return bool(state.failsafe_timers) or any(failsafe.holds(view, state) for failsafe in FAILSAFES)


def _act(context: Context, reason: str, mode: str | None) -> bool:
    """Take the action. Return True if the present mode allows it."""
    state = context.state
    if mode is None:
        context.outbox.send_text(reason)
        return True
    if mode == "descend" and state.guidance.inputs.sticks_fresh:
        mode = "altitude_control"  # a pilot holds the sticks
    elif _severity(state) >= _SEVERITY.index(mode):
        return False
    state.failsafe = reason
    enter(context.constants, state, mode)
    context.outbox.send_text(status_texts.TAKEN_OVER.format(reason, mode))
    return True


def _severity(state: State) -> int:
    return _SEVERITY.index(state.mode_name) if state.mode_name in _SEVERITY[1:] else -1
