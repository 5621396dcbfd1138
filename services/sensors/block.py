"""Compiled sensor block: true state in, readings out at the sensor's rate."""

from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import Key
from lapwing.dynamics.terrain import surface
from lapwing.dynamics.vector import subtract
from lapwing.dynamics.vehicles.visible_body import VisibleBody
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import compile_source, dispatch, generic
from lapwing.services.sensors.sensor_inputs import ROTORS, OtherVehicle, Truth


class Instrument(NamedTuple):
    """Parameters of the block."""

    sensor: Any  # parameters: Imu, Gps, ...
    key: Key  # key of its random numbers
    gravity: float  # [m/s^2] at home, 0 without a gravity effect
    around: Environment
    others: tuple[VisibleBody, ...] = ()  # vehicles that it sees, in the order of its further inputs


_sample = dispatch(DispatchTable("sample"))
_initial = dispatch(DispatchTable("initial"))


@generic(inline=True)
def first_rotors(speed: types.Type) -> Any:
    """Return the speeds of ROTORS rotors, 0 beyond the vehicle's number."""
    items = ", ".join(f"speed[{i}]" if i < len(speed) else "0.0" for i in range(ROTORS))
    return compile_source("first_rotors(speed)", {}, f"return ({items})")


@generic(inline=True)
def _other_vehicles(bodies: types.Type, inputs: types.Type) -> Any:
    """Return the `OtherVehicle`s, whose true states follow the vehicle's own in the inputs."""
    items = "".join(
        f"OtherVehicle(inputs[{i + 1}].value.position_world, inputs[{i + 1}].value.attitude, bodies[{i}]), "
        for i in range(len(bodies))
    )
    return compile_source("other_vehicles(bodies, inputs)", {"OtherVehicle": OtherVehicle}, f"return ({items})")


@always_inline
def step(p: Instrument, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple, int]:
    """Output the reading at `tick`; the instrument starts at tick 0."""
    x, around = inputs[0].value, p.around
    ground, _ = surface(around.terrain, x.position_world[0], x.position_world[1])
    air = subtract(x.velocity_world, x.wind_world)
    current, thrust, speed = 0.0, 0.0, 0.0
    for value in x.motor_current:
        current += value
    for value in x.rotor_thrust:
        thrust += value
    for value in x.rotor_speed:
        speed += value
    truth = Truth(
        x.position_world,
        x.attitude,
        x.velocity_world,
        x.omega_body,
        x.acceleration_world,
        x.position_world[2] - ground,
        p.gravity,
        around.home,
        around.atmosphere,
        around.magnetic_field_world,
        around.terrain,
        x.angular_acceleration_body,
        current,
        air,
        x.air_density,
        thrust,
        speed / len(x.rotor_speed),
        first_rotors(x.rotor_speed),
        _other_vehicles(p.others, inputs),
    )
    if tick == 0:
        s = _initial(p.sensor, p.key, truth)
    s, reading = _sample(p.sensor, s, p.key, tick, truth)
    return s, (reading,), CONTINUE
