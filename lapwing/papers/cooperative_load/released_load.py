"""Quadrotors and a released load as free bodies (theory, eq. (7.29))."""

from typing import NamedTuple

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import Vec3, add, scale
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import map_index
from lapwing.papers.cooperative_load import cooperative_load as formation
from lapwing.papers.cooperative_load.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
)


class ReleasedLoadParameters(NamedTuple):
    """Parameters of the bodies; tuples have one entry for each quadrotor."""

    quad_mass: tuple[float, ...]  # [kg]
    quad_inertia: tuple[Vec3, ...]  # [kg m^2] principal moments
    gravity: float  # [m/s^2]
    control: LiftCommand


class ReleasedLoadState(NamedTuple):
    """State of quadrotors and load; world frame ENU."""

    load_position: Vec3  # [m]
    load_velocity: Vec3  # [m/s]
    attitude: tuple[Quaternion, ...]
    omega_body: tuple[Vec3, ...]  # [rad/s]
    quad_position: tuple[Vec3, ...]  # [m]
    quad_velocity: tuple[Vec3, ...]  # [m/s]


def release(p: CooperativeLoadParameters, x: CooperativeLoadState) -> tuple[ReleasedLoadParameters, ReleasedLoadState]:
    """Return load and vehicles as separate free bodies without links, with their motion and command."""
    quads = range(len(x.link))
    positions = tuple(formation.quad_position(p, x, i) for i in quads)
    velocities = tuple(formation.quad_velocity(p, x, i) for i in quads)
    return (
        ReleasedLoadParameters(p.quad_mass, p.quad_inertia, p.gravity, p.control),
        ReleasedLoadState(x.load_position, x.load_velocity, x.attitude, x.omega_body, positions, velocities),
    )


@always_inline
def _acceleration(p, x, i):
    force = formation.thrust_world(x, p.control.thrust, i)
    return add(scale(1.0 / p.quad_mass[i], force), (0.0, 0.0, -p.gravity))


@always_inline
def rate(p, t, x):
    """Return the tangent of the free bodies (theory, eqs. (7.18) and (7.29))."""
    return ReleasedLoadState(
        x.load_velocity,
        (0.0, 0.0, -p.gravity),
        x.omega_body,
        map_index(formation.body_rate, x.quad_position, p, x, p.control),
        x.quad_velocity,
        map_index(_acceleration, x.quad_position, p, x),
    )


RATES[ReleasedLoadParameters] = rate
