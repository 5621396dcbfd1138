"""Outer loops of the PX4 cascade: position P, velocity PID in acceleration, acceleration to thrust vector."""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.services.autopilot.mixer import clamp


class Parameters(NamedTuple):
    """Gains and limits of the outer loops; horizontal and vertical ones differ."""

    position_xy: float  # [1/s]
    position_z: float  # [1/s]
    velocity_p: Vec3  # [1/s] x, y, z
    velocity_i: Vec3  # [1/s^2]
    velocity_d: Vec3  # dimensionless: acceleration over acceleration
    speed_xy: float  # [m/s] limit
    climb: float  # [m/s] limit
    sink: float  # [m/s] limit
    tilt: float  # [rad] limit
    hover: float  # collective that carries the weight, fraction
    thrust_min: float  # collective, fraction
    thrust_max: float  # collective, fraction
    margin_xy: float  # collective reserved for horizontal control at a high vertical demand, fraction
    gravity: float  # [m/s^2]


@always_inline
def limit_horizontal(x: float, y: float, dx: float, dy: float, limit: float) -> tuple[float, float]:
    """Return (x, y) + (dx, dy) within a circle; (x, y) has priority, and (dx, dy) is shortened first."""
    first = math.sqrt(x * x + y * y)
    if first >= limit:
        part = limit / max(first, 1e-9)
        return part * x, part * y
    square = dx * dx + dy * dy
    if math.square(x + dx) + math.square(y + dy) <= limit * limit:
        return x + dx, y + dy
    along = x * dx + y * dy
    part = (math.sqrt(along * along + square * (limit * limit - first * first)) - along) / square
    return x + part * dx, y + part * dy


@always_inline
def velocity_setpoint(p: Parameters, error: Vec3, feed_forward: Vec3) -> Vec3:
    """Return the velocity setpoint [m/s] of a position error [m] and a feed-forward velocity [m/s], world."""
    k = p.position_xy
    x, y = limit_horizontal(k * error[0], k * error[1], feed_forward[0], feed_forward[1], p.speed_xy)
    return x, y, clamp(p.position_z * error[2] + feed_forward[2], -p.sink, p.climb)


@always_inline
def acceleration_setpoint(p: Parameters, error: Vec3, integral: Vec3, acceleration: Vec3, feed_forward: Vec3) -> Vec3:
    """Return the acceleration setpoint [m/s^2], world.

    Args:
        p: parameters.
        error: of the velocity [m/s].
        integral: [m/s^2], with its gain.
        acceleration: measured [m/s^2]; the D term acts on it, not on the error.
        feed_forward: [m/s^2].
    """
    kp, kd = p.velocity_p, p.velocity_d
    return (
        kp[0] * error[0] + integral[0] - kd[0] * acceleration[0] + feed_forward[0],
        kp[1] * error[1] + integral[1] - kd[1] * acceleration[1] + feed_forward[1],
        kp[2] * error[2] + integral[2] - kd[2] * acceleration[2] + feed_forward[2],
    )


@always_inline
def thrust_setpoint(p: Parameters, acceleration: Vec3) -> Vec3:
    """Return the thrust vector, world, as a fraction of the maximum collective.

    The direction is that of (a_x, a_y, g), within the tilt limit: a vertical acceleration does not change the tilt. The
    vertical component is hover (1 + a_z / g). Of the maximum, horizontal control keeps its margin, then the vertical
    component has priority.
    """
    ax, ay, g = acceleration[0], acceleration[1], p.gravity
    horizontal = math.sqrt(ax * ax + ay * ay)
    slope = min(horizontal / g, math.tan(p.tilt))
    share = slope / max(horizontal, 1e-9)  # slope per horizontal acceleration [s^2/m]
    upright = 1.0 / math.sqrt(1.0 + slope * slope)
    collective = max(p.hover * (1.0 + acceleration[2] / g) / upright, p.thrust_min)
    z, tx, ty = collective * upright, collective * upright * share * ax, collective * upright * share * ay
    demand = math.sqrt(tx * tx + ty * ty)
    limited = min(demand, p.margin_xy)
    z = min(z, math.sqrt(p.thrust_max * p.thrust_max - limited * limited))
    room = math.sqrt(max(p.thrust_max * p.thrust_max - z * z, 0.0))
    part = min(1.0, room / max(demand, 1e-9))
    return part * tx, part * ty, z


@always_inline
def velocity_integral(p: Parameters, integral: Vec3, error: Vec3, acceleration: Vec3, thrust: Vec3, dt: float) -> Vec3:
    """Return the integral term [m/s^2] after dt [s].

    Horizontally the part of the acceleration that the limits removed flows back (tracking anti-windup: Astrom and
    Rundqwist, "Integrator Windup and How to Avoid It", ACC 1989); vertically it holds while it would increase
    saturation.

    Args:
        p: parameters.
        integral: before [m/s^2].
        error: of the velocity [m/s].
        acceleration: setpoint [m/s^2].
        thrust: `thrust_setpoint` of it.
        dt: length of the tick [s].
    """
    achieved_x, achieved_y = p.gravity / p.hover * thrust[0], p.gravity / p.hover * thrust[1]
    ex, ey, ez = error
    ax, ay = acceleration[0], acceleration[1]
    if ax * ax + ay * ay > achieved_x * achieved_x + achieved_y * achieved_y:
        back = 2.0 / p.velocity_p[0]
        ex, ey = ex - back * (ax - achieved_x), ey - back * (ay - achieved_y)
    collective = math.sqrt(thrust[0] * thrust[0] + thrust[1] * thrust[1] + thrust[2] * thrust[2])
    if (collective <= p.thrust_min and ez < 0.0) or (collective >= p.thrust_max - 1e-9 and ez > 0.0):
        ez = 0.0
    ki = p.velocity_i
    return (
        integral[0] + ki[0] * dt * ex,
        integral[1] + ki[1] * dt * ey,
        clamp(integral[2] + ki[2] * dt * ez, -p.gravity, p.gravity),
    )
