"""Handler of the failure injection command."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lapwing.services.autopilot.commander.command_handlers import Denied, handles
from lapwing.services.autopilot.commander.flight_mode import value
from lapwing.services.autopilot.commander.transitions import Context
from lapwing.services.common.failure_types import KINDS, UNITS, rejection_text, supported_types, with_satellites

ENABLE = "SYS_FAILURE_EN"
LEVEL = "SYS_FAIL_BAT_LVL"
THRESHOLDS = ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR")  # by the value of LEVEL, from 1
INSTANCES = {"motor": "motors", "gyro": "gyro", "accelerometer": "accelerometer"}  # fields of `Faults` with several
BELOW = 0.01  # charge of a wrong battery below the threshold, as in PX4


@handles("inject_failure")
def inject_failure(context: Context, command: Any) -> None:
    """Inject a failure. Values: index in UNITS, failure type, number or bits of the instances (`_instances`)."""
    values = [value(command.values, k) for k in range(4)]
    if not (values[0] in range(len(UNITS)) and values[1] in range(len(KINDS))):
        raise Denied("inject failure: expected a unit and a failure type")
    unit, kind = UNITS[int(values[0])], int(values[1])
    constants, state, outbox = context.constants, context.state, context.outbox
    if not state.guidance.parameters[ENABLE]:
        raise Denied(f"inject failure: {ENABLE} is 0; set it to 1 first")
    if unit not in constants.failing:
        raise Denied(f"inject failure: the vehicle has no {unit}")
    if kind not in supported_types(unit):
        raise Denied(f"inject failure: {rejection_text(unit)}")
    count = {"motor": constants.rotors, "gyro": constants.imus, "accelerometer": constants.imus}.get(unit, 1)
    numbers = _instances(unit, count, *values[2:])
    instances = f" {', '.join(map(str, numbers))}" if len(numbers) < count else ""
    if unit in INSTANCES:
        field = INSTANCES[unit]
        changes: dict[str, Any] = {field: _with_instances(getattr(state.faults, field), kind, numbers)}
    else:
        changes = {unit: kind, "battery_charge": _low_charge(state.guidance.parameters)}
    state.faults = state.faults._replace(**changes)
    outbox.faults = with_satellites(state.faults, state.guidance.parameters, constants.has_gps)
    outbox.send_text(f"injected: {unit}{instances} {KINDS[kind]}")


def _instances(unit: str, count: int, number: float, bits: float) -> list[int]:
    """Return the instance numbers, from 1 to `count`: one by its number, all for 0, or those of the bits."""
    if math.isnan(number) and bits > 0.0:  # as in MAVLink; False for NaN
        last = math.frexp(bits)[1] if math.isfinite(bits) else math.inf
        requested = [last] if last > count else [k + 1 for k in range(count) if int(bits) >> k & 1]
    else:
        requested = [] if math.isnan(number) or number == 0.0 else [number]
    for k in requested:
        if k not in range(1, count + 1):
            raise Denied(f"inject failure: {unit} {k:g} does not exist; expected 1 to {count}, 0 for all")
    return [int(k) for k in requested] or list(range(1, count + 1))


def _with_instances(failures: tuple[int, ...], kind: int, numbers: Sequence[int]) -> tuple[int, ...]:
    """Return the failure types of all instances, with `kind` for those in `numbers`."""
    return tuple(kind if k in numbers else before for k, before in enumerate(failures, start=1))


def _low_charge(parameters: Mapping[str, float]) -> float:
    """Return the charge of a wrong battery, just below the threshold that LEVEL selects."""
    return max(0.0, parameters[THRESHOLDS[round(parameters[LEVEL]) - 1]] - BELOW)
