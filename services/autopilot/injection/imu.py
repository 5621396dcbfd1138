"""Failures of gyroscope and accelerometer, which come in one reading: without one of them it counts for nothing."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.kernel import leaf
from services.autopilot.injection.memory import Memory, silent
from services.common.failures import STUCK, WRONG
from services.common.ports import ImuReading

TURN, PUSH = 0.2, 2.0  # [rad/s] about x, [m/s^2] along z by which a wrong one is off


class ImuInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


@leaf
def step(p: ImuInjection, s: Memory, tick: int, inputs: tuple[Received, ...]) -> tuple[Memory, tuple, int]:
    """What arrives of the reading of the tick."""
    r, gyro, accelerometer = inputs[0].value, p.faults.value.gyro, p.faults.value.accelerometer
    omega, force = r.omega_body, r.specific_force_body
    if gyro == STUCK:
        omega = s.last.omega_body
    elif gyro == WRONG:
        omega = (omega[0] + TURN, omega[1], omega[2])
    if accelerometer == STUCK:
        force = s.last.specific_force_body
    elif accelerometer == WRONG:
        force = (force[0], force[1], force[2] + PUSH)
    valid = r.valid and not silent(gyro, s.readings) and not silent(accelerometer, s.readings)
    last = ImuReading(
        omega if gyro == STUCK else r.omega_body,
        force if accelerometer == STUCK else r.specific_force_body,
        r.omega_variance, r.specific_force_variance, r.valid,
    )  # fmt: skip
    x = ImuReading(omega, force, r.omega_variance, r.specific_force_variance, valid)
    return Memory(last, s.readings + 1), (x,), GO_ON
