"""Plant of a multirotor with one rigid body or five bodies: motor voltages in, true state out."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.dynamics import effects
from lapwing.dynamics.effects._external_inputs import with_inputs_stored
from lapwing.dynamics.effects.payload_release import RELEASED, PayloadRelease
from lapwing.dynamics.noise import Key
from lapwing.dynamics.vehicles import step_bound
from lapwing.dynamics.vehicles.multirotor import advance, observe
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters, MultirotorState, motion_of
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import compile_source, generic
from lapwing.kernels.state_tree import finite
from lapwing.services.common.ports import BatteryReading, PerRotor, TrueState
from lapwing.services.plant.blocks.termination import termination_status

for _name in effects.names():
    effects.get(_name)  # registers its hooks: a run configuration has only the class of an effect's parameters


class MultirotorPlant(NamedTuple):
    """Parameters of the block: a vehicle and its integration."""

    method: Any  # `Method()` of an integrator
    vehicle: MultirotorParameters
    key: Key  # key of its random numbers
    step: float  # [s]
    steps: int  # per tick
    interval: float  # [s] length of a tick
    off: PerRotor  # [V] before the first command
    settle: int  # [ticks] from the end of the mission to the end of the run


class MultirotorPlantState(NamedTuple):
    """State of the block."""

    vehicle: MultirotorState
    last: int  # last tick of the run


@always_inline
def step(
    p: MultirotorPlant, s: MultirotorPlantState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[MultirotorPlantState, tuple[TrueState, BatteryReading], int]:
    """Advance to `tick` under the received command; output the initial state at tick 0.

    The inputs are actuators, status, and the named inputs of effects.
    """
    vehicle, command = apply_inputs(p, s, inputs)
    if tick > 0:
        vehicle = advance(p.method, p.vehicle, p.key, tick - 1, vehicle, command, p.step, p.steps)
    return output(p, p.vehicle, s, tick, vehicle, command, inputs[1])


@always_inline
def apply_inputs(
    p: MultirotorPlant, s: MultirotorPlantState, inputs: tuple[InputSample, ...]
) -> tuple[MultirotorState, PerRotor]:
    """Return (vehicle with the inputs of its effects, motor voltages [V]). See `step` for arguments."""
    actuators, status = inputs[0], inputs[1]
    command = actuators.value.motor_voltage if actuators.due else p.off
    memory = with_inputs_stored(p.vehicle.effects, s.vehicle.memory, inputs[2:])
    vehicle = MultirotorState(s.vehicle.motion, memory)
    if status.due and status.value.released:
        vehicle = MultirotorState(vehicle.motion, release_payload(p.vehicle.effects, vehicle.memory))
    return vehicle, command


@always_inline
def output(
    p: MultirotorPlant,
    parameters: MultirotorParameters,
    s: MultirotorPlantState,
    tick: int,
    vehicle: MultirotorState,
    command: PerRotor,
    status: InputSample,
) -> tuple[MultirotorPlantState, tuple[TrueState, BatteryReading], int]:
    """Return the result of `step` for a vehicle with these parameters after its motion to `tick`."""
    motion = motion_of(parameters.layout, vehicle.motion)
    o = observe(parameters, tick, p.interval, vehicle, command)
    last = min(s.last, tick + p.settle) if status.due and status.value.finished else s.last
    truth = TrueState(
        motion.position_world, motion.attitude, motion.velocity_world, motion.omega_body, o.acceleration_world,
        motion.rotor_speed, o.motor_voltage, o.motor_current, o.motor_power, o.thrust, o.torque,
        o.wind_world, o.air_density, o.in_contact, o.angular_acceleration_body,
    )  # fmt: skip
    battery = BatteryReading(o.battery[0], o.battery[1], o.battery[2], o.battery[3])
    is_valid = finite(vehicle.motion) and step_bound.is_valid(motion, p.step)
    return MultirotorPlantState(vehicle, last), (truth, battery), termination_status(tick, last, is_valid)


@generic(inline=True)
def release_payload(effects: types.BaseTuple, memory: types.BaseTuple) -> Callable:
    """Return the effects' discrete state after the release of the payload; unchanged without a payload."""
    carried = [getattr(kind, "instance_class", None) is PayloadRelease for kind in effects]
    parts = "".join("released, " if payload else f"memory[{k}], " for k, payload in enumerate(carried))
    body = f"return ({parts})" if any(carried) else "return memory"
    return compile_source("release_payload(effects, memory)", {"released": RELEASED}, body)
