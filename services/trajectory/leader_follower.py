"""Compiled trajectory block of a vehicle offset to a leader's trajectory."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import Vec3, add
from lapwing.kernels import always_inline, math
from lapwing.services.common.ports import Setpoint
from lapwing.services.trajectory import polynomial_piece
from lapwing.services.trajectory.block import TrajectoryPath


class FollowedPath(NamedTuple):
    """The leader's trajectory and the displacement from it."""

    leader: TrajectoryPath
    relative: TrajectoryPath  # displacement from the leader; its origin is the initial distance
    heading: bool  # displacements are in axes along the leader's heading; otherwise in world axes


@always_inline
def rotate_setpoint(heading: Vec3, offset: Setpoint) -> tuple[Vec3, Vec3, Vec3]:
    """Return world position, velocity and acceleration of a setpoint in a frame rotated about z.

    `heading` has angle, rate and acceleration of the frame [rad], [rad/s], [rad/s^2].
    """
    angle, rate, acceleration = heading
    s, c = math.sincos(angle)
    (x, y, z), (vx, vy, vz) = offset.position_world, offset.velocity_world
    ax, ay, az = offset.acceleration_world
    vx, vy, ax, ay = (  # by Coriolis' theorem
        vx - rate * y,
        vy + rate * x,
        ax - 2.0 * rate * vy - rate * rate * x - acceleration * y,
        ay + 2.0 * rate * vx - rate * rate * y + acceleration * x,
    )
    return (
        (c * x - s * y, s * x + c * y, z),
        (c * vx - s * vy, s * vx + c * vy, vz),
        (c * ax - s * ay, s * ax + c * ay, az),
    )


@always_inline
def step(p: FollowedPath, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[Setpoint], int]:
    """Evaluate the setpoint at `tick`, with the vehicle's own phases (theory, eq. (4.1a)); the state is unused."""
    t = tick * p.relative.interval
    leader = polynomial_piece.evaluate(p.leader.path, t, p.leader.final)
    offset = polynomial_piece.evaluate(p.relative.path, t, p.relative.final)
    heading = polynomial_piece.channel_at(p.leader.path.yaw, t) if p.heading else (0.0, 0.0, 0.0)
    position, velocity, acceleration = rotate_setpoint(heading, offset)
    lands = leader.landing_speed >= 0.0 and offset.landing_speed >= 0.0
    return (
        s,
        (
            Setpoint(
                add(leader.position_world, position),
                add(leader.velocity_world, velocity),
                add(leader.acceleration_world, acceleration),
                leader.yaw + offset.yaw,
                leader.yaw_rate + offset.yaw_rate,
                offset.phase,
                offset.final and leader.final,
                offset.release,
                leader.landing_speed + offset.landing_speed if lands else -1.0,
            ),
        ),
        CONTINUE,
    )
