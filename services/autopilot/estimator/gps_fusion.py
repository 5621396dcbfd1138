"""Fusion of delayed position and velocity of a satellite receiver (theory.md, eqs. (3.29) and (3.30))."""

from lapwing.dynamics.geodesy import geodetic_to_enu
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO, Vec3, add, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.estimator.covariance_inflation import doubt
from lapwing.services.autopilot.estimator.delayed_measurements import (
    Noise,
    late_innovation_variances,
    late_position_row,
    late_velocity_row,
)
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import GPS, GPS_VELOCITY, HISTORY, State, corrected
from lapwing.services.autopilot.estimator.fuse import absorb
from lapwing.services.autopilot.estimator.measurement_checks import judge, repeated


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
    gained = subtract(i.velocity_gain, velocity_gain)
    velocity = subtract(s.nominal.velocity_world, gained)
    if delay == 0.0:
        return position, velocity, delay, i.force_world, i.force_world
    upward = (0.0, 0.0, p.gravity)
    weighted, mean = add(scale(2.0 / (delay * delay), moment), upward), add(scale(1.0 / delay, gained), upward)
    return position, velocity, delay, weighted, mean


@always_inline
def _noise_since(p: Estimator, s: State, age: int) -> Noise:
    """Return the process noise of the last `age` ticks."""
    tick, history = s.inertial.tick, s.memory.history
    age = min(age, tick, HISTORY - 1)
    v = vp = pp = av = ap = 0.0
    for k in range(age):
        q, turned = history[(tick - k) % HISTORY, 6], history[(tick - k) % HISTORY, 7]
        v += q
        vp += q * (k * p.interval)
        pp += q * math.square(k * p.interval)
        before = math.square((age - k) * p.interval)  # [s^2] of the delay, before this tick
        av += turned * before
        ap += turned * before * before / 4.0
    return Noise(v, vp, pp, av, ap)


@always_inline
def _wander_variance(p: Estimator, axis: int) -> float:
    return math.square(p.gps_wander_vertical if axis == 2 else p.gps_wander_horizontal)


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
    if not valid or repeated(m, GPS, (latitude_deg, longitude_deg, height), ZERO, variance[0] > 0.0, 1):
        judge(m, GPS, False, 0.0)
        return s
    measured = geodetic_to_enu(p.home, latitude_deg, longitude_deg, height)
    position, _, delay, force, _ = _past(p, s, age)
    since = _noise_since(p, s, age)
    innovation = subtract(measured, add(position, s.nominal.gps_wander))
    r = rotation_matrix(s.nominal.attitude)
    accepted = True
    nis = 0.0
    for axis in range(3):
        late_position_row(m, force, r, axis, delay)
        white = max(variance[axis] - _wander_variance(p, axis), 0.01 * variance[axis])
        _, largest = late_innovation_variances(m, axis, since, white, force)
        ratio = innovation[axis] * innovation[axis] / largest
        nis += ratio
        accepted = accepted and ratio < p.gate * p.gate
    if accepted:
        nis = 0.0
        for axis in range(3):
            late_position_row(m, force, r, axis, delay)
            white = max(variance[axis] - _wander_variance(p, axis), 0.01 * variance[axis])
            s_gain, _ = late_innovation_variances(m, axis, since, white, force)
            nis += absorb(m, innovation[axis], s_gain)
    judge(m, GPS, accepted, nis)
    if not accepted:
        doubt(p, m, GPS)
    return corrected(s)


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
    if not valid or repeated(m, GPS_VELOCITY, velocity_world, ZERO, variance > 0.0, 1):
        judge(m, GPS_VELOCITY, False, 0.0)
        return s
    _, velocity, delay, _, force = _past(p, s, age)
    since = _noise_since(p, s, age)
    innovation = subtract(velocity_world, velocity)
    r = rotation_matrix(s.nominal.attitude)
    accepted = True
    nis = 0.0
    for axis in range(3):
        late_velocity_row(m, force, r, axis, delay)
        _, largest = late_innovation_variances(m, axis, since, variance, force)
        ratio = innovation[axis] * innovation[axis] / largest
        nis += ratio
        accepted = accepted and ratio < p.gate * p.gate
    if accepted:
        nis = 0.0
        for axis in range(3):
            late_velocity_row(m, force, r, axis, delay)
            s_gain, _ = late_innovation_variances(m, axis, since, variance, force)
            nis += absorb(m, innovation[axis], s_gain)
    judge(m, GPS_VELOCITY, accepted, nis)
    if not accepted:
        doubt(p, m, GPS_VELOCITY)
    return corrected(s)
