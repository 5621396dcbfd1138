"""One instrument, compiled: the true state in, its reading out at its own rate."""

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from cosim.part import GO_ON, Received
from dynamics.generate import implements
from dynamics.geodesy import Home
from dynamics.kernel import leaf
from dynamics.noise import Key
from dynamics.vector import Vec3
from services.sensors.truth import Truth


class Surroundings(NamedTuple):
    """What instruments measure apart from the motion."""

    gravity: float  # [m/s^2]
    home: Home
    temperature_celsius: float  # [deg C] of the air at the ground
    magnetic_field_world: Vec3  # [T]


class Instrument(NamedTuple):
    """A sensor that the vehicle carries."""

    sensor: Any  # parameters: Imu, Gps, ...
    key: Key  # of its random numbers
    around: Surroundings


def _sample(p: Any, s: Any, key: Key, tick: int, truth: Truth) -> tuple:
    """`sample` of the sensor whose parameters `p` are."""
    raise NotImplementedError("compiled code only")


@implements(_sample, inline=True)
def _sample_of(p: types.Type, s: types.Type, key: types.Type, tick: types.Type, truth: types.Type) -> Callable:
    found = sys.modules[p.instance_class.__module__].sample
    return lambda p, s, key, tick, truth: found(p, s, key, tick, truth)


def _initial(p: Any, key: Key, truth: Truth) -> Any:
    """`initial` of the sensor whose parameters `p` are."""
    raise NotImplementedError("compiled code only")


@implements(_initial, inline=True)
def _initial_of(p: types.Type, key: types.Type, truth: types.Type) -> Callable:
    found = sys.modules[p.instance_class.__module__].initial
    return lambda p, key, truth: found(p, key, truth)


@leaf
def step(p: Instrument, s: Any, tick: int, inputs: tuple[Received, ...]) -> tuple[Any, tuple, int]:
    """The reading at `tick`; the instrument is switched on at tick 0."""
    x, around = inputs[0].value, p.around
    truth = Truth(
        x.position_world,
        x.attitude,
        x.velocity_world,
        x.omega_body,
        x.acceleration_world,
        x.position_world[2],
        around.gravity,
        around.home,
        around.temperature_celsius,
        around.magnetic_field_world,
    )
    if tick == 0:
        s = _initial(p.sensor, p.key, truth)
    s, reading = _sample(p.sensor, s, p.key, tick, truth)
    return s, (reading,), GO_ON
