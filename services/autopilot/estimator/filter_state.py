"""Filter state, initialisation and output (theory, section 3.3).

The error state has 24 components. Its attitude part is a world rotation vector: R = exp(theta) R_estimated.
"""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.lie.quaternion import Quaternion, exp, from_matrix, multiply, normalise, rotation_matrix
from lapwing.dynamics.vector import ZERO, Vec3, add, cross, dot, norm, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.estimator.filter_parameters import NO_STATIC_PRESSURE_ERROR, Estimator
from lapwing.services.common.ports import StateEstimate

SIZE = 24
THETA, VELOCITY, POSITION, GYRO, ACCELEROMETER, WANDER, IRON = 0, 3, 6, 9, 12, 15, 18
HEADING, BAROMETER, SCALE = 21, 22, 23
CONSIDERED = 24  # errors of instruments that are considered and not estimated (theory, eqs. (3.60) and (3.67))
GYRO_SCALE, GYRO_ALIGNMENT, MAG_SCALE, MAG_ALIGNMENT, LIFT = 0, 3, 6, 9, 11  # LIFT: accelerometers, eq. (3.66)
DRIFT = 14  # warm-up of the gyroscopes, eq. (3.69)
WIND, WIND_SQUARES, GUST = 17, 19, 21  # static pressure error, eq. (3.67); columns 22 and 23 are empty
CONSIDERED_IN_CALM = 20  # columns of a filter without static pressure error, in groups of four
# Rows of `considered`: variances, row of H, covariance with the innovation
VARIANCE, ROW, PRODUCT = SIZE, SIZE + 1, SIZE + 2

SOURCES = ("imu", "gps", "gps_velocity", "barometer", "sonar", "magnetometer")
IMU, GPS, GPS_VELOCITY, BARO, SONAR, MAG = range(len(SOURCES))
FLOW = len(SOURCES)  # also monitored; it only replaces GPS, so its absence is no fault
NAMES = (*SOURCES, "optical_flow")  # all monitored sources
WATCHED = len(NAMES)
PACKED = SIZE * (SIZE + 1) // 2 + WATCHED

HISTORY = 128  # IMU readings stored for delayed measurements
NEVER = -1


class Nominal(NamedTuple):
    """Nominal state, about which the error state is defined."""

    attitude: Quaternion
    velocity_world: Vec3  # [m/s]
    position_world: Vec3  # [m]
    gyro_bias: Vec3  # [rad/s]
    accelerometer_bias: Vec3  # [m/s^2]
    gps_correlated_error: Vec3  # [m]
    magnetometer_bias: Vec3  # [T] body
    heading_bias: float  # [rad]
    barometer_bias: float  # [m]
    sonar_scale: float  # error, ratio


class Inertial(NamedTuple):
    """The last IMU reading and its integrals."""

    tick: int  # number of readings
    omega: Vec3  # [rad/s] as read
    force: Vec3  # [m/s^2] as read
    force_world: Vec3  # [m/s^2] specific force, bias removed
    velocity_gain: Vec3  # [m/s] acceleration integrated since the start, never corrected
    distance_gain: Vec3  # [m] velocity_gain integrated
    spike: bool  # the last reading was rejected as a spike and its predecessor reused
    cut: int  # [readings] since the motors stopped over the ground; 0: running


class Memory(NamedTuple):
    """Arrays that steps change in place; a state must not be used after its successor is computed."""

    covariance: np.ndarray  # (24, 24)
    correction: np.ndarray  # (24,) pending correction of the estimate
    row: np.ndarray  # (24,) of the measurement matrix
    product: np.ndarray  # (24,) covariance times row
    considered: np.ndarray  # (27, 24) covariance of the error with these parameters; then VARIANCE, ROW, PRODUCT
    history: np.ndarray  # (HISTORY, 8) velocity_gain, distance_gain, noise added to velocity and attitude
    since: np.ndarray  # (WATCHED,) ticks since a source was last accepted, or NEVER
    rejected: np.ndarray  # (WATCHED,) 1 if the last reading of a source was rejected
    repeats: np.ndarray  # (WATCHED,) number of consecutive equal readings
    last: np.ndarray  # (WATCHED, 6) last reading of each source
    trend: np.ndarray  # (2, 2) of horizontal innovations of GPS position and velocity (theory, eq. (3.64))
    nis: np.ndarray  # (WATCHED,) last normalised innovation squared of each source
    packed: np.ndarray  # (1, PACKED) upper triangle of the covariance and `nis`, as published


class State(NamedTuple):
    """State of the filter."""

    nominal: Nominal
    inertial: Inertial
    memory: Memory


@always_inline
def attitude_from_gravity(p: Estimator, specific_force_body: Vec3, field_body: Vec3) -> Quaternion:
    """Return the attitude at rest from gravity and magnetic field (theory, eq. (3.20))."""
    up = scale(1.0 / norm(specific_force_body), specific_force_body)
    across = subtract(field_body, scale(dot(field_body, up), up))
    forth = scale(1.0 / norm(across), across)
    left = cross(up, forth)
    bx, by, _ = p.magnetic_field_world
    k = 1.0 / math.hypot(bx, by)
    east = scale(k, subtract(scale(bx, forth), scale(by, left)))
    north = scale(k, add(scale(by, forth), scale(bx, left)))
    return from_matrix((east[0], east[1], east[2], north[0], north[1], north[2], up[0], up[1], up[2]))


def new_memory() -> Memory:
    """Return the arrays of a state."""
    return Memory(
        np.zeros((SIZE, SIZE)),
        np.zeros(SIZE),
        np.zeros(SIZE),
        np.zeros(SIZE),
        np.zeros((SIZE + 3, CONSIDERED)),
        np.zeros((HISTORY, 8)),
        np.zeros(WATCHED, np.int64),
        np.zeros(WATCHED, np.int64),
        np.zeros(WATCHED, np.int64),
        np.zeros((WATCHED, 6)),
        np.zeros((2, 2)),
        np.zeros(WATCHED),
        np.zeros((1, PACKED)),
    )


@always_inline
def warm_up_left(p: Estimator, tick: int) -> float:
    """Return the fraction of the gyroscopes' warm-up that is still to come."""
    return math.exp(-p.interval * tick / p.gyro_warm_up_time)


@always_inline
def correlate_warm_up(p: Estimator, m: Memory, tick: int) -> None:
    """Correlate unknown biases of the gyroscopes, which contain the rest of the warm-up, with its amplitude."""
    for k in range(3):
        m.considered[GYRO + k, DRIFT + k] = -warm_up_left(p, tick) * m.considered[VARIANCE, DRIFT + k]


@kernel
def initial(p: Estimator, m: Memory, position_world: Vec3, specific_force_body: Vec3, field_body: Vec3) -> State:
    """Return the state of a vehicle at rest.

    Args:
        p: `Estimator`.
        m: arrays of the state, overwritten.
        position_world: [m] start position with standard deviation `p.start_std`.
        specific_force_body: [m/s^2] accelerometer reading or mean.
        field_body: [T] magnetometer reading or mean.
    """
    covariance = m.covariance
    covariance[:] = 0.0
    for i in range(3):
        covariance[THETA + i, THETA + i] = p.attitude_std * p.attitude_std
        covariance[VELOCITY + i, VELOCITY + i] = 0.1 * 0.1
        covariance[POSITION + i, POSITION + i] = p.start_std * p.start_std
        covariance[GYRO + i, GYRO + i] = p.gyro_bias_std * p.gyro_bias_std
        covariance[ACCELEROMETER + i, ACCELEROMETER + i] = p.accelerometer_bias_std * p.accelerometer_bias_std
        covariance[WANDER + i, WANDER + i] = p.gps_correlated_error_horizontal * p.gps_correlated_error_horizontal
        covariance[IRON + i, IRON + i] = p.magnetometer_bias_std * p.magnetometer_bias_std
    covariance[WANDER + 2, WANDER + 2] = p.gps_correlated_error_vertical * p.gps_correlated_error_vertical
    covariance[BAROMETER, BAROMETER] = 50.0 * 50.0
    covariance[SCALE, SCALE] = p.sonar_scale_std * p.sonar_scale_std
    m.considered[:] = 0.0
    m.considered[VARIANCE, GYRO_SCALE : GYRO_SCALE + 3] = p.gyro_scale_std * p.gyro_scale_std
    m.considered[VARIANCE, GYRO_ALIGNMENT : GYRO_ALIGNMENT + 3] = p.gyro_alignment_std * p.gyro_alignment_std
    m.considered[VARIANCE, MAG_SCALE : MAG_SCALE + 3] = p.magnetometer_scale_std * p.magnetometer_scale_std
    alignment = p.magnetometer_alignment_std * p.magnetometer_alignment_std
    m.considered[VARIANCE, MAG_ALIGNMENT : MAG_ALIGNMENT + 2] = covariance[HEADING, HEADING] = alignment
    m.correction[:] = m.row[:] = m.product[:] = 0.0
    m.history[:] = 0.0
    m.since[:] = NEVER
    m.rejected[:] = m.repeats[:] = 0
    m.last[:] = math.nan
    m.nis[:] = 0.0
    alignment = p.accelerometer_alignment_std * p.accelerometer_alignment_std
    m.considered[VARIANCE, LIFT : LIFT + 2] = alignment
    m.considered[VARIANCE, LIFT + 2] = p.accelerometer_scale_std * p.accelerometer_scale_std
    m.considered[VARIANCE, DRIFT : DRIFT + 3] = p.gyro_warm_up_std * p.gyro_warm_up_std
    correlate_warm_up(p, m, 0)
    if p.static_pressure_error != NO_STATIC_PRESSURE_ERROR and p.wind_speed > 0.0:
        square = p.wind_speed * p.wind_speed
        m.considered[VARIANCE, WIND : WIND + 2] = 0.5 * square
        m.considered[VARIANCE, WIND_SQUARES : WIND_SQUARES + 2] = 0.5 * square * square
        m.considered[VARIANCE, GUST] = 1.0
    attitude = attitude_from_gravity(p, specific_force_body, field_body)
    nominal = Nominal(attitude, ZERO, position_world, ZERO, ZERO, ZERO, ZERO, 0.0, 0.0, 0.0)
    return State(nominal, Inertial(0, ZERO, specific_force_body, (0.0, 0.0, p.gravity), ZERO, ZERO, False, 0), m)


@always_inline
def three(array: np.ndarray, start: int) -> Vec3:
    """Return three neighbouring elements of an array."""
    return (array[start], array[start + 1], array[start + 2])


@kernel
def apply_correction(s: State) -> State:
    """Return the state with the pending correction applied (theory, eq. (3.25))."""
    n, d = s.nominal, s.memory.correction
    nominal = Nominal(
        normalise(multiply(exp(three(d, THETA)), n.attitude)),
        add(n.velocity_world, three(d, VELOCITY)),
        add(n.position_world, three(d, POSITION)),
        add(n.gyro_bias, three(d, GYRO)),
        add(n.accelerometer_bias, three(d, ACCELEROMETER)),
        add(n.gps_correlated_error, three(d, WANDER)),
        add(n.magnetometer_bias, three(d, IRON)),
        n.heading_bias + d[HEADING],
        n.barometer_bias + d[BAROMETER],
        n.sonar_scale + d[SCALE],
    )
    d[:] = 0.0
    return State(nominal, s.inertial, s.memory)


@always_inline
def _deviations(covariance: np.ndarray, start: int) -> Vec3:
    return (
        math.sqrt(covariance[start, start]),
        math.sqrt(covariance[start + 1, start + 1]),
        math.sqrt(covariance[start + 2, start + 2]),
    )


@always_inline
def _deviation_along(covariance: np.ndarray, axis_world: Vec3) -> float:
    """Return the standard deviation of the attitude error about an axis."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += axis_world[i] * covariance[THETA + i, THETA + j] * axis_world[j]
    return math.sqrt(total)


@always_inline
def _health(p: Estimator, m: Memory, position_std: Vec3, attitude_std: Vec3) -> tuple[int, int]:
    health = 0
    rejected = 0
    flow_replaces_gps = m.since[FLOW] != NEVER and m.since[FLOW] * p.interval < p.patience
    for i in range(len(SOURCES)):
        if m.rejected[i] == 1:
            rejected |= 1 << i
        lost = m.rejected[i] == 1 or m.since[i] * p.interval > p.patience
        if lost and not (flow_replaces_gps and i in (GPS, GPS_VELOCITY)):
            health |= 1 << i
    if m.rejected[FLOW] == 1:
        rejected |= 1 << FLOW
    if max(position_std[0], position_std[1], position_std[2]) > p.position_std:
        health |= 64
    if max(attitude_std[0], attitude_std[1], attitude_std[2]) > p.attitude_std:
        health |= 128
    return health, rejected


@kernel
def estimate(p: Estimator, s: State) -> StateEstimate:
    """Return the present estimate."""
    n, i, c = s.nominal, s.inertial, s.memory.covariance
    r = rotation_matrix(n.attitude)
    position_std = _deviations(c, POSITION)
    attitude_std = (
        _deviation_along(c, (r[0], r[3], r[6])),
        _deviation_along(c, (r[1], r[4], r[7])),
        _deviation_along(c, (r[2], r[5], r[8])),
    )
    health, rejected = _health(p, s.memory, position_std, attitude_std)
    acceleration = (i.force_world[0], i.force_world[1], i.force_world[2] - p.gravity)
    return StateEstimate(
        n.position_world, n.attitude, n.velocity_world, subtract(i.omega, n.gyro_bias), acceleration,
        n.gyro_bias, n.accelerometer_bias, position_std, _deviations(c, VELOCITY), attitude_std, health, rejected,
    )  # fmt: skip
