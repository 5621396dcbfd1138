"""Compiled block: holds a firmware's last outputs between exchanges, as motor voltages and status at every tick."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import always_inline, math
from lapwing.kernels.codegen import map_tuple, reduce_tuple
from lapwing.services.common.ports import AutopilotStatus, MotorCommand, PerRotor, Setpoint

COMMAND = "firmware"  # port of `FirmwareCommand`
UNKNOWN = (math.nan, math.nan, math.nan)


class FirmwareCommand(NamedTuple):
    """Last outputs of the firmware, latched."""

    duty: PerRotor  # fraction of the supply voltage, in the airframe's order
    armed: bool = False
    landed: bool = True
    finished: bool = False
    status_text_id: int = 0  # index of the status texts
    attitude_reference: Vec3 = ZERO  # [rad] roll, pitch, yaw
    follows: bool = False  # the scene's trajectory commands the vehicle


class Hold(NamedTuple):
    """Parameters of the block; its inputs are command, battery, and the trajectory if the firmware follows it."""

    voltage_max: float  # [V] of the supply before the first reading of the battery
    none: PerRotor  # zero for each rotor


class HeldState(NamedTuple):
    """State of the block."""

    supply: float  # [V]


@always_inline
def _volts(supply: float, duty: float, _: float) -> float:
    return duty * supply


@always_inline
def _reference(follows: bool, sample: InputSample, _: InputSample) -> Any:
    x = sample.value
    velocity = x.velocity_world if follows else UNKNOWN
    return Setpoint(x.position_world, velocity, x.acceleration_world, x.yaw, x.yaw_rate, x.phase, x.final)


@always_inline
def _phase(_: int, phase: int, reference: Setpoint, __: Setpoint) -> int:
    return reference.phase


@always_inline
def step(p: Hold, s: HeldState, tick: int, inputs: tuple[InputSample, ...]) -> tuple[HeldState, tuple, int]:
    """Return the motor command, the status, and the reference of the trajectory at `tick`.

    Its velocity is not a number while the firmware does not follow it.
    """
    command, battery = inputs[0].value, inputs[1]
    references = map_tuple(_reference, command.follows, inputs[2:], inputs[2:])
    supply = battery.value.voltage if battery.due else s.supply
    motors = MotorCommand(
        map_tuple(_volts, supply, command.duty, p.none), command.armed, p.none, command.attitude_reference
    )
    phase = reduce_tuple(_phase, 0, 0, references, references)
    status = AutopilotStatus(phase, command.status_text_id, command.armed, command.landed, command.finished)
    return HeldState(supply), (motors, status, *references), CONTINUE
