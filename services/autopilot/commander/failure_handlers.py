"""The operator's command to inject a failure."""

from collections.abc import Mapping
from typing import Any

from services.autopilot.commander.command_handlers import Denied, handles
from services.autopilot.commander.flight_mode import value
from services.autopilot.commander.transitions import Context
from services.common.failures import KINDS, UNITS, Faults, possible, refusal

ENABLE = "SYS_FAILURE_EN"
LEVEL, THRESHOLDS = "SYS_FAIL_BAT_LVL", ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")  # for its values from 1 on
BELOW = 0.01  # by which a wrong battery reports less than the threshold, as PX4's does


@handles("inject_failure")
def inject_failure(context: Context, command: Any) -> None:
    """Values: number of the unit in UNITS, what is wrong with it, number of a motor from 1, 0 for all."""
    given = [value(command.values, k) for k in range(3)]
    if not (given[0] in range(len(UNITS)) and given[1] in range(len(KINDS))):
        raise Denied("inject failure: expected a unit and what is wrong with it")
    unit, kind = UNITS[int(given[0])], int(given[1])
    constants, state, outbox = context.constants, context.state, context.outbox
    if not state.guidance.parameters[ENABLE]:
        raise Denied(f"inject failure: {ENABLE} is 0; set it to 1 first")
    if unit not in constants.failing:
        raise Denied(f"inject failure: there is no {unit}")
    if kind not in possible(unit):
        raise Denied(f"inject failure: {refusal(unit)}")
    instance = ""
    if unit == "motor":
        number = given[2] if given[2] == given[2] else 0.0  # NaN: left out
        if number not in range(constants.rotors + 1):
            raise Denied(f"inject failure: there is no motor {number:g}; expected 1 to {constants.rotors}, 0 for all")
        state.faults = _with_motors(state.faults, kind, int(number))
        instance = f" {number:.0f}" if number else ""
    else:
        found: dict[str, Any] = {unit: kind, "battery_charge": _low_charge(state.guidance.parameters)}
        state.faults = state.faults._replace(**found)
    outbox.faults = state.faults
    outbox.say(f"injected: {unit}{instance} {KINDS[kind]}")


def _with_motors(faults: Faults, kind: int, number: int) -> Faults:
    """The same where something is wrong with one motor, or with all (0)."""
    motors = (kind if number in (0, k) else before for k, before in enumerate(faults.motors, start=1))
    return faults._replace(motors=tuple(motors))


def _low_charge(parameters: Mapping[str, float]) -> float:
    """The charge that a wrong battery reports, just below the threshold that LEVEL chooses."""
    return max(0.0, parameters[THRESHOLDS[round(parameters[LEVEL]) - 1]] - BELOW)
