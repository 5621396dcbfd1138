"""Rows and innovation variances of delayed measurements (theory, eqs. (3.30) and (3.35))."""

from typing import NamedTuple

from lapwing.dynamics.vector import Mat3, Vec3, dot
from lapwing.kernels import always_inline, noinline
from lapwing.services.autopilot.estimator.filter_state import POSITION, SIZE, VELOCITY, WANDER, Memory
from lapwing.services.autopilot.estimator.fuse import FLOOR, acceleration_row, clear, innovation_variance


class Noise(NamedTuple):
    """Process noise of a time span, equal and independent in all axes."""

    velocity: float  # [(m/s)^2]
    velocity_position: float  # [m^2/s]
    position: float  # [m^2]
    attitude_velocity: float  # [rad^2 s^2] attitude noise weighted for the row of a delayed velocity
    attitude_position: float  # [rad^2 s^4] attitude noise weighted for the row of a delayed position


@always_inline
def delayed_position_row(m: Memory, force_world: Vec3, r: Mat3, axis: int, delay: float) -> None:
    """Fill the row of the position `delay` seconds ago, with the receiver's correlated error (theory, eq. (3.30)).

    `force_world` is the specific force during the delay, weighted by its effect on the position.
    """
    clear(m)
    m.row[POSITION + axis] = 1.0
    m.row[VELOCITY + axis] = -delay
    m.row[WANDER + axis] = 1.0
    acceleration_row(m, force_world, r, axis, 0.5 * delay * delay)


@always_inline
def delayed_velocity_row(m: Memory, force_world: Vec3, r: Mat3, axis: int, delay: float) -> None:
    """Fill the row of the velocity `delay` seconds ago; `force_world` is the mean specific force since."""
    clear(m)
    m.row[VELOCITY + axis] = 1.0
    acceleration_row(m, force_world, r, axis, -delay)


@noinline
def delayed_innovation_variances(
    m: Memory, axis: int, since: Noise, variance: float, force_world: Vec3
) -> tuple[float, float]:
    """Return the innovation variances for gain and gate of a delayed row (theory, eqs. (3.35) and (3.36)).

    Writes the covariance of innovation and present error to `m.product`. The noise since the measurement, such as an
    impact, was not measured; the gate allows for its correction by other sources.

    Args:
        m: `Memory` with a filled row.
        axis: axis of the row.
        since: process noise since the measurement.
        variance: variance of the measurement.
        force_world: specific force of the row [m/s^2].
    """
    v, p = m.row[VELOCITY + axis], m.row[POSITION + axis]
    noise = v * v * since.velocity + 2.0 * v * p * since.velocity_position + p * p * since.position
    across = dot(force_world, force_world) - force_world[axis] * force_world[axis]
    noise += across * (since.attitude_position if p > 0.0 else since.attitude_velocity)
    now = innovation_variance(m, 0.0)
    then = max(now - noise, 0.0)
    for i in range(SIZE):
        m.product[i] *= then / now
    return then + variance + FLOOR, now + noise + variance
