"""Motors that are off: they get no voltage, and nothing of the controller knows."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.common.ports import MotorCommand


class MotorInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


@leaf
def _unless_off(motors: int, k: int, volts: float) -> float:
    return 0.0 if motors >> k & 1 else volts


@leaf
def step(p: MotorInjection, s: Any, tick: int, inputs: tuple[Received, ...]) -> tuple[Any, tuple, int]:
    """The command that reaches the motors."""
    c, off = inputs[0].value, p.faults.value.motors
    a, b, d, e = c.motor_voltage
    volts = (_unless_off(off, 0, a), _unless_off(off, 1, b), _unless_off(off, 2, d), _unless_off(off, 3, e))
    return s, (MotorCommand(volts, c.armed, c.thrust, c.attitude_reference),), GO_ON
