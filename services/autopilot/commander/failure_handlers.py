"""The operator's command to inject a failure."""

from typing import Any

from services.autopilot.commander.command_handlers import Denied, handles
from services.autopilot.commander.flight_mode import value
from services.autopilot.commander.transitions import Context
from services.common.failures import OFF, SLOW, SOUND, UNITS

ENABLE = "SYS_FAILURE_EN"
_NAMES = ("sound", "off", "stuck", "wrong", "slow")
MOTORS = 4


@handles("inject_failure")
def inject_failure(context: Context, command: Any) -> None:
    """Values: number of the unit in UNITS, what is wrong with it, number of a motor from 1, 0 for all."""
    given = [value(command.values, k) for k in range(3)]
    if not (given[0] in range(len(UNITS)) and given[1] in range(SLOW + 1)):
        raise Denied("inject failure: expected a unit and what is wrong with it")
    unit, kind, instance = UNITS[int(given[0])], int(given[1]), int(given[2]) if given[2] in range(MOTORS + 1) else 0
    constants, state, outbox = context.constants, context.state, context.outbox
    if not constants.failing:
        raise Denied(f"inject failure: {ENABLE} must be 1 from the start of the run on")
    if not state.guidance.parameters[ENABLE]:
        raise Denied(f"inject failure: {ENABLE} is 0")
    if unit not in constants.failing:
        raise Denied(f"inject failure: there is no {unit}")
    if unit in ("motor", "battery") and kind not in (SOUND, OFF):
        raise Denied(f"inject failure: a {unit} can only be off")
    if unit == "motor":
        chosen = (1 << MOTORS) - 1 if instance == 0 else 1 << instance - 1
        motors = state.faults.motors | chosen if kind == OFF else state.faults.motors & ~chosen
        state.faults = state.faults._replace(motors=motors)
    else:
        state.faults = state.faults._replace(**{unit: kind})
    outbox.faults = state.faults
    outbox.say(f"injected: {unit}{f' {instance}' if unit == 'motor' and instance else ''} {_NAMES[kind]}")
