"""Failures of gyroscope and accelerometer; a reading is invalid without one of them."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.noise import Key
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline
from lapwing.services.autopilot.failure_injection.failure_state import Memory, garbage, is_dropped
from lapwing.services.common.failure_types import DELAYED, GARBAGE, STUCK, WRONG
from lapwing.services.common.ports import ImuReading

TURN, PUSH = 0.2, 2.0  # [rad/s] about x, [m/s^2] along z: errors of a wrong instrument
FULL_TURN, FULL_PUSH = 35.0, 160.0  # [rad/s], [m/s^2] full scale, range of garbage
_GYRO, _ACCELEROMETER = 0, 1  # lanes of their random numbers


class ImuInjection(NamedTuple):
    """Parameters of the block."""

    faults: Any  # cell of `Faults`
    key: Key  # key of the random numbers
    unit: int  # index of the unit


@always_inline
def _choose(kind: int, now: Vec3, stuck: Vec3, late: Vec3, wrong: Vec3, random: Vec3) -> Vec3:
    if kind == STUCK:
        return stuck
    if kind == DELAYED:
        return late
    if kind == WRONG:
        return wrong
    return random if kind == GARBAGE else now


@always_inline
def step(p: ImuInjection, s: Memory, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Memory, tuple, int]:
    """Output the received reading; the second input is the reading `DELAY` ago."""
    r, before, faults = inputs[0].value, inputs[1], p.faults.value
    gyro, accelerometer = faults.gyro[p.unit], faults.accelerometer[p.unit]
    late, turn, push = before.value, r.omega_body, r.specific_force_body
    omega = _choose(
        gyro, turn, s.last.omega_body, late.omega_body, (turn[0] + TURN, turn[1], turn[2]),
        garbage(p.key, tick, _GYRO, FULL_TURN) if gyro == GARBAGE else turn,
    )  # fmt: skip
    force = _choose(
        accelerometer, push, s.last.specific_force_body, late.specific_force_body, (push[0], push[1], push[2] + PUSH),
        garbage(p.key, tick, _ACCELEROMETER, FULL_PUSH) if accelerometer == GARBAGE else push,
    )  # fmt: skip
    valid = late.valid and before.due if DELAYED in (gyro, accelerometer) else r.valid
    valid = valid and not is_dropped(gyro, p.key, _GYRO, s.readings)
    valid = valid and not is_dropped(accelerometer, p.key, _ACCELEROMETER, s.readings)
    last = ImuReading(
        omega if gyro == STUCK else turn,
        force if accelerometer == STUCK else push,
        r.omega_variance, r.specific_force_variance, r.valid,
    )  # fmt: skip
    x = ImuReading(omega, force, r.omega_variance, r.specific_force_variance, valid)
    return Memory(last, s.readings + 1), (x,), CONTINUE
