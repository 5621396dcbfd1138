"""Proportional control of body rates with control allocation and inverse motor model, for many vehicles at once."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math

OMEGA = 10  # first column of the body rates in a motion


class RateController(NamedTuple):
    """Parameters of the rate controller."""

    bandwidth: float  # [rad/s] bandwidth
    inertia_body: Vec3  # [kg m^2] principal moments
    mixer: np.ndarray  # thrust of each rotor for 1 N of thrust and 1 N m about body x, y, z, shape (rotors, 4)
    thrust_coefficient: float  # [N s^2]
    voltage_per_speed: float  # [V s]
    voltage_max: float  # [V]


@always_inline
def omega_body(memory, at, stride):
    """Return the body rates [rad/s] of a vehicle whose motion starts at `at`, with `stride` between its numbers."""
    start = at + OMEGA * stride
    return (memory[start], memory[start + stride], memory[start + 2 * stride])


@always_inline
def command(c, memory, at, stride, setpoints, commands, member):
    """Write the motor voltages [V] of a member.

    The torque is inertia * bandwidth * (setpoint - omega) + omega x (inertia omega).

    Args:
        c: a RateController.
        memory: numbers of the vehicles.
        at: index of the first number of the member's motion.
        stride: distance between numbers of a member.
        setpoints: thrust [N] and body rates [rad/s], shape (members, 4).
        commands: shape (members, rotors), changed.
        member: row of `setpoints` and `commands`.
    """
    wx, wy, wz = omega_body(memory, at, stride)
    ix, iy, iz = c.inertia_body
    thrust = setpoints[member, 0]
    x = ix * c.bandwidth * (setpoints[member, 1] - wx) + (iz - iy) * wy * wz
    y = iy * c.bandwidth * (setpoints[member, 2] - wy) + (ix - iz) * wz * wx
    z = iz * c.bandwidth * (setpoints[member, 3] - wz) + (iy - ix) * wx * wy
    for i in range(commands.shape[1]):
        single = ((c.mixer[i, 0] * thrust + c.mixer[i, 1] * x) + c.mixer[i, 2] * y) + c.mixer[i, 3] * z
        speed = math.sqrt(max(single, 0.0) / c.thrust_coefficient)
        commands[member, i] = min(speed * c.voltage_per_speed, c.voltage_max)
