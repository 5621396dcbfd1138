"""Direct motor control and motor failures between controller and motors."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_index, map_tuple
from lapwing.services.autopilot.failure_injection.failure_state import SLOWED, Memory
from lapwing.services.autopilot.motor import Motor, thrusts_at
from lapwing.services.common.failure_types import OFF, SLOW, STUCK, WRONG
from lapwing.services.common.ports import MotorCommand, PerRotor

WEAKENED = 0.7  # voltage factor of a wrong motor: about half of the thrust


class DirectMotorControl(NamedTuple):
    """Voltages from the operator."""

    on: bool  # they replace the controller's
    motor_voltage: PerRotor  # [V]


class MotorInjection(NamedTuple):
    """Parameters of the block."""

    faults: Any  # cell of `Faults`
    direct: Any  # cell of `DirectMotorControl`
    motor: Motor


@always_inline
def _received_voltage(kinds: tuple[int, ...], before: PerRotor, volts: PerRotor, count: int, k: int) -> float:
    """Return the voltage command of motor k: the last one if stuck, one in `SLOWED` if slow."""
    if kinds[k] == STUCK or (kinds[k] == SLOW and count % SLOWED != 0):
        return before[k]
    return volts[k]


@always_inline
def _motor_voltage(_: float, kind: int, volts: float) -> float:
    """Return the voltage [V] of a motor."""
    if kind == OFF:
        return 0.0
    return WEAKENED * volts if kind == WRONG else volts


@always_inline
def step(p: MotorInjection, s: Memory, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Memory, tuple, int]:
    """Output the command that reaches the motors; the controller does not see it."""
    c, d, kinds = inputs[0].value, p.direct.value, p.faults.value.motors
    commanded = d.motor_voltage if d.on else c.motor_voltage
    thrust = thrusts_at(p.motor, commanded) if d.on else c.thrust
    received = map_index(_received_voltage, commanded, kinds, s.last, commanded, s.readings)
    volts = map_tuple(_motor_voltage, 0.0, kinds, received)
    return Memory(received, s.readings + 1), (MotorCommand(volts, c.armed, thrust, c.attitude_reference),), CONTINUE
