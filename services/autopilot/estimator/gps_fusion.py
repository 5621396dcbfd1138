"""Fusion of delayed position and velocity of a satellite receiver (theory, eqs. (3.29), (3.30) and (3.35))."""

from typing import NamedTuple

from lapwing.dynamics.geodesy import geodetic_to_enu
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO, Mat3, Vec3, add, dot, scale, subtract
from lapwing.kernels import always_inline, kernel, math, noinline
from lapwing.services.autopilot.estimator.covariance_inflation import inflate_covariance, inflate_imu_states
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    GPS,
    GPS_VELOCITY,
    HISTORY,
    POSITION,
    SIZE,
    VELOCITY,
    WANDER,
    Memory,
    State,
    apply_correction,
)
from lapwing.services.autopilot.estimator.fuse import FLOOR, acceleration_row, apply_update, clear, innovation_variance
from lapwing.services.autopilot.estimator.measurement_checks import is_stuck, record_gate_result


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


_TREND = 0.8  # weight of the former trend at each fix
_REST = math.sqrt(1.0 - _TREND * _TREND)


@always_inline
def _past(p: Estimator, s: State, age: int) -> tuple[Vec3, Vec3, float, Vec3, Vec3]:
    """Return position and velocity `age` ticks ago, the delay [s], and the specific force since [m/s^2].

    The specific force is weighted for the row of a position and of a velocity.
    """
    i, m = s.inertial, s.memory
    age = min(age, i.tick, HISTORY - 1)
    slot = (i.tick - age) % HISTORY
    h = m.history
    velocity_gain = (h[slot, 0], h[slot, 1], h[slot, 2])
    distance_gain = (h[slot, 3], h[slot, 4], h[slot, 5])
    delay = age * p.interval
    moment = subtract(scale(delay, i.velocity_gain), subtract(i.distance_gain, distance_gain))
    position = add(subtract(s.nominal.position_world, scale(delay, s.nominal.velocity_world)), moment)
    velocity_change = subtract(i.velocity_gain, velocity_gain)
    velocity = subtract(s.nominal.velocity_world, velocity_change)
    if delay == 0.0:
        return position, velocity, delay, i.force_world, i.force_world
    upward = (0.0, 0.0, p.gravity)
    weighted, mean = add(scale(2.0 / (delay * delay), moment), upward), add(scale(1.0 / delay, velocity_change), upward)
    return position, velocity, delay, weighted, mean


@always_inline
def _noise_since(p: Estimator, s: State, age: int) -> Noise:
    """Return the process noise of the last `age` ticks."""
    tick, history = s.inertial.tick, s.memory.history
    age = min(age, tick, HISTORY - 1)
    v = vp = pp = av = ap = 0.0
    for k in range(age):
        q, q_attitude = history[(tick - k) % HISTORY, 6], history[(tick - k) % HISTORY, 7]
        v += q
        vp += q * (k * p.interval)
        pp += q * math.square(k * p.interval)
        earlier = math.square((age - k) * p.interval)  # [s^2] part of the delay before this tick
        av += q_attitude * earlier
        ap += q_attitude * earlier * earlier / 4.0
    return Noise(v, vp, pp, av, ap)


@always_inline
def _white_variance(p: Estimator, variance: Vec3, axis: int) -> float:
    """Return the variance of the white noise, without that of the correlated error [m^2]."""
    correlated = math.square(p.gps_correlated_error_vertical if axis == 2 else p.gps_correlated_error_horizontal)
    return max(variance[axis] - correlated, 0.01 * variance[axis])


@always_inline
def _row(m: Memory, source: int, force: Vec3, r: Mat3, axis: int, delay: float) -> None:
    """Write the measurement row of a delayed position or velocity."""
    if source == GPS:
        delayed_position_row(m, force, r, axis, delay)
    else:
        delayed_velocity_row(m, force, r, axis, delay)


@always_inline
def _fuse(
    p: Estimator, s: State, source: int, innovation: Vec3, variance: Vec3, force: Vec3, delay: float, age: int
) -> State:
    """Gate the three axes together, fuse them one after the other, and record the result.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        source: GPS or GPS_VELOCITY.
        innovation: [m] or [m/s], world.
        variance: of the white noise per axis.
        force: weighted specific force since the fix [m/s^2].
        delay: [s].
        age: delay [ticks].
    """
    m, since, r = s.memory, _noise_since(p, s, age), rotation_matrix(s.nominal.attitude)
    accepted, is_drifting, nis, row = True, False, 0.0, source - GPS
    for axis in range(3):
        _row(m, source, force, r, axis, delay)
        _, largest = delayed_innovation_variances(m, axis, since, variance[axis], force)
        ratio = innovation[axis] * innovation[axis] / largest
        nis += ratio
        accepted = accepted and ratio < p.gate * p.gate
        if axis < 2:  # without the height, whose other sources may be wrong
            m.trend[row, axis] = _TREND * m.trend[row, axis] + _REST * innovation[axis] / math.sqrt(largest)
            is_drifting = is_drifting or math.fabs(m.trend[row, axis]) > p.gate
    is_drifting = is_drifting and accepted  # beyond the gate the reading is wrong, not the estimate
    accepted = accepted and not is_drifting
    if accepted:
        nis = 0.0
        for axis in range(3):
            _row(m, source, force, r, axis, delay)
            s_gain, _ = delayed_innovation_variances(m, axis, since, variance[axis], force)
            nis += apply_update(m, innovation[axis], s_gain)
    record_gate_result(m, source, accepted, nis)
    if is_drifting:
        inflate_imu_states(m)
    elif not accepted:
        m.trend[row, :] = 0.0
        inflate_covariance(p, m, source)
    return apply_correction(s)


@kernel
def update_gps(
    p: Estimator,
    s: State,
    latitude_deg: float,
    longitude_deg: float,
    height: float,
    variance: Vec3,
    age: int,
    valid: bool,
) -> State:
    """Return the state after a position fix.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        latitude_deg: [deg].
        longitude_deg: [deg].
        height: [m] over the ellipsoid.
        variance: [m^2] east, north, up, from the receiver.
        age: delay of the fix [ticks].
        valid: False without a fix.
    """
    m = s.memory
    if not valid or is_stuck(m, GPS, (latitude_deg, longitude_deg, height), ZERO, variance[0] > 0.0, 1):
        record_gate_result(m, GPS, False, 0.0)
        return s
    measured = geodetic_to_enu(p.home, latitude_deg, longitude_deg, height)
    position, _, delay, force, _ = _past(p, s, age)
    innovation = subtract(measured, add(position, s.nominal.gps_correlated_error))
    white = (_white_variance(p, variance, 0), _white_variance(p, variance, 1), _white_variance(p, variance, 2))
    return _fuse(p, s, GPS, innovation, white, force, delay, age)


@kernel
def update_gps_velocity(p: Estimator, s: State, velocity_world: Vec3, variance: float, age: int, valid: bool) -> State:
    """Return the state after a velocity fix.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        velocity_world: [m/s].
        variance: [(m/s)^2] per axis.
        age: delay of the fix [ticks].
        valid: False without a fix.
    """
    m = s.memory
    if not valid or is_stuck(m, GPS_VELOCITY, velocity_world, ZERO, variance > 0.0, 1):
        record_gate_result(m, GPS_VELOCITY, False, 0.0)
        return s
    _, velocity, delay, _, force = _past(p, s, age)
    innovation = subtract(velocity_world, velocity)
    return _fuse(p, s, GPS_VELOCITY, innovation, (variance, variance, variance), force, delay, age)
