"""One instrument, compiled: the true state in, its reading out at its own rate."""

import sys
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.noise import Key
from lapwing.dynamics.terrain import surface
from lapwing.dynamics.vector import dot, subtract
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import overload_for
from lapwing.services.sensors.sensor_inputs import Truth


class Instrument(NamedTuple):
    """A sensor that the vehicle carries."""

    sensor: Any  # parameters: Imu, Gps, ...
    key: Key  # of its random numbers
    gravity: float  # [m/s^2] at home, 0 where no effect gives any
    around: Environment


def _sample(p: Any, s: Any, key: Key, tick: int, truth: Truth) -> tuple:
    """`sample` of the sensor whose parameters `p` are."""
    raise NotImplementedError("compiled code only")


@overload_for(_sample, inline=True)
def _sample_of(p: types.Type, s: types.Type, key: types.Type, tick: types.Type, truth: types.Type) -> Any:
    return sys.modules[p.instance_class.__module__].sample


def _initial(p: Any, key: Key, truth: Truth) -> Any:
    """`initial` of the sensor whose parameters `p` are."""
    raise NotImplementedError("compiled code only")


@overload_for(_initial, inline=True)
def _initial_of(p: types.Type, key: types.Type, truth: types.Type) -> Any:
    return sys.modules[p.instance_class.__module__].initial


@always_inline
def step(p: Instrument, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple, int]:
    """The reading at `tick`; the instrument is switched on at tick 0."""
    x, around = inputs[0].value, p.around
    ground, _ = surface(around.terrain, x.position_world[0], x.position_world[1])
    air = subtract(x.velocity_world, x.wind_world)
    current, thrust, speed = 0.0, 0.0, 0.0
    for of_one in x.motor_current:
        current += of_one
    for of_one in x.rotor_thrust:
        thrust += of_one
    for of_one in x.rotor_speed:
        speed += of_one
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
        0.5 * x.air_density * dot(air, air),
        current,
        air,
        x.air_density,
        thrust,
        speed / len(x.rotor_speed),
    )
    if tick == 0:
        s = _initial(p.sensor, p.key, truth)
    s, reading = _sample(p.sensor, s, p.key, tick, truth)
    return s, (reading,), CONTINUE
