"""Fusion of heading, optical flow and standstill.

The magnetometer's heading: theory, eqs. (3.33) and (3.63); optical flow as a replacement of GPS velocity: eq. (3.45);
zero velocity on the ground with motors off: eq. (3.34).
"""

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO, Mat3, Vec3, apply, cross, dot, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.estimator.covariance_inflation import inflate_covariance
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    FLOW,
    GPS_VELOCITY,
    GYRO,
    HEADING,
    HISTORY,
    IRON,
    MAG,
    MAG_ALIGNMENT,
    MAG_SCALE,
    NEVER,
    ROW,
    THETA,
    VELOCITY,
    Memory,
    State,
    apply_correction,
    three,
)
from lapwing.services.autopilot.estimator.fuse import acceleration_row, clear, fuse, innovation_variance
from lapwing.services.autopilot.estimator.measurement_checks import is_stuck, record_gate_result


@kernel
def update_magnetometer(p: Estimator, s: State, field_body: Vec3, variance: float, valid: bool) -> State:
    """Return the state after a magnetometer reading; only its horizontal direction is used.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        field_body: [T].
        variance: [T^2] per axis.
        valid: False without a reading.
    """
    m = s.memory
    if not valid or is_stuck(m, MAG, field_body, ZERO, variance > 0.0, p.frozen):
        record_gate_result(m, MAG, False, 0.0)
        return s
    bx, by, bz = p.magnetic_field_world
    horizontal = bx * bx + by * by
    r = rotation_matrix(s.nominal.attitude)
    field = subtract(field_body, s.nominal.magnetometer_bias)
    fx, fy, _ = apply(r, field)
    turn = math.atan2(fx * by - fy * bx, fx * bx + fy * by)  # from the measured to the true field
    clear(m)
    m.row[THETA] = -bz * bx / horizontal
    m.row[THETA + 1] = -bz * by / horizontal
    m.row[THETA + 2] = 1.0
    for i in range(3):
        m.row[IRON + i] = (by * r[i] - bx * r[3 + i]) / horizontal
        m.considered[ROW, MAG_SCALE + i] = m.row[IRON + i] * field[i]
    iron = three(m.row, IRON)
    by_iron = cross(field, iron)  # (a x field) . iron = a . (field x iron)
    m.considered[ROW, MAG_ALIGNMENT] = by_iron[0]
    m.considered[ROW, MAG_ALIGNMENT + 1] = by_iron[1]
    m.row[HEADING] = -by_iron[2]
    innovation = turn + by_iron[2] * s.nominal.heading_bias
    nis = innovation * innovation / innovation_variance(m, variance / horizontal)
    accepted = nis < p.gate * p.gate
    if accepted:
        fuse(m, innovation, variance / horizontal)
    record_gate_result(m, MAG, accepted, nis)
    if not accepted:
        inflate_covariance(p, m, MAG)
    return apply_correction(s)


_ARM = 0.7  # [m] from the feet to the instruments while the vehicle rocks on them
_VIBRATION_READINGS = 64  # readings for the variance of the vibration at rest
_GROWTH = 20.0  # [intervals] in which motion between the readings changes the estimated velocity


@kernel
def shake_variance(p: Estimator, s: State, axis: int, specific_force_variance: float) -> float:
    """Return the variance of the acceleration [(m/s^2)^2] along a world axis while wind shakes the vehicle on its feet.

    Args:
        p: `Estimator`.
        s: `State` after `predict`.
        axis: 0 to 2.
        specific_force_variance: [(m/s^2)^2] of the readings' white noise, which is not part of the result.
    """
    tick, h = s.inertial.tick, s.memory.history
    count = min(tick - 1, _VIBRATION_READINGS, HISTORY - 2)
    if count < 2:
        return 0.0
    total, squares = 0.0, 0.0
    for k in range(count):
        gain = h[(tick - k) % HISTORY, axis] - h[(tick - k - 1) % HISTORY, axis]
        total += gain
        squares += gain * gain
    variance = (squares - total * total / count) / ((count - 1) * math.square(p.interval))
    # a gain is the mean of two readings, which halves the variance of white noise
    return max(2.0 * variance - specific_force_variance, 0.0)


@kernel
def update_standstill(p: Estimator, s: State, omega_variance: float, specific_force_variance: float) -> State:
    """Return the state after measurements of zero velocity, rate and acceleration.

    Args:
        p: `Estimator`.
        s: `State` after `predict` with a reading at rest; its arrays are changed in place.
        omega_variance: [(rad/s)^2] of that reading.
        specific_force_variance: [(m/s^2)^2] of that reading.
    """
    n, i, m = s.nominal, s.inertial, s.memory
    r, dt = rotation_matrix(n.attitude), p.interval
    shake = (
        shake_variance(p, s, 0, specific_force_variance),
        shake_variance(p, s, 1, specific_force_variance),
        shake_variance(p, s, 2, specific_force_variance),
    )
    rocking = 0.5 * (shake[0] + shake[1]) * math.square(dt / _ARM)
    for axis in range(3):
        clear(m)
        m.row[VELOCITY + axis] = 1.0
        fuse(m, -n.velocity_world[axis], _GROWTH * shake[axis] * (dt * dt))
        clear(m)
        m.row[GYRO + axis] = 1.0
        fuse(m, i.omega[axis] - n.gyro_bias[axis], omega_variance + (0.0 if axis == 2 else rocking))
        clear(m)
        acceleration_row(m, i.force_world, r, axis, 1.0)
        acceleration = i.force_world[axis] - (p.gravity if axis == 2 else 0.0)
        fuse(m, -acceleration, specific_force_variance + shake[axis])
    return apply_correction(s)


_CORRELATED = 100.0  # readings (2 s) over which the scale error is correlated


@always_inline
def flow_row(m: Memory, r: Mat3, velocity_world: Vec3, axis: int, distance: float) -> float:
    """Fill the row of the flow about body x (axis 0) or y (1). Return the expected flow [rad/s]."""
    k = 1.0 / distance if axis == 0 else -1.0 / distance
    across = (r[1], r[4], r[7]) if axis == 0 else (r[0], r[3], r[6])  # body y, body x: direction of the ground's motion
    attitude_effect = cross(across, velocity_world)
    clear(m)
    for j in range(3):
        m.row[VELOCITY + j] = k * across[j]
        m.row[THETA + j] = k * attitude_effect[j]
    return k * dot(across, velocity_world)


@kernel
def update_flow(
    p: Estimator,
    s: State,
    flow: tuple[float, float],
    rate: tuple[float, float],
    distance: float,
    variance: float,
    valid: bool,
) -> State:
    """Return the state after an optical flow reading, unchanged while GPS velocities are accepted.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        flow: [rad/s] about body x and y.
        rate: [rad/s] of the camera about body x and y.
        distance: [m] to the ground along body -z.
        variance: [(rad/s)^2] per axis.
        valid: False without a reading.
    """
    m = s.memory
    readings, rotation = (flow[0], flow[1], distance), (rate[0], rate[1], 0.0)
    if not valid or not distance > 0.0 or is_stuck(m, FLOW, readings, rotation, variance > 0.0, p.frozen):
        record_gate_result(m, FLOW, False, 0.0)
        return s
    gps_accepted = m.rejected[GPS_VELOCITY] == 0 and m.since[GPS_VELOCITY] != NEVER
    if gps_accepted and m.since[GPS_VELOCITY] * p.interval <= p.patience:
        m.rejected[FLOW] = 0
        return s
    r, velocity = rotation_matrix(s.nominal.attitude), s.nominal.velocity_world
    passing = (flow[0] - rate[0], flow[1] - rate[1])
    expected = math.hypot(flow_row(m, r, velocity, 0, distance), flow_row(m, r, velocity, 1, distance))
    # the scale error is that of the expected flow, to keep the gate effective
    noise = variance + _CORRELATED * math.square(p.flow_scale_std * expected)
    nis, accepted = 0.0, True
    for axis in range(2):
        innovation = passing[axis] - flow_row(m, r, velocity, axis, distance)
        ratio = innovation * innovation / innovation_variance(m, noise)
        nis += ratio
        accepted = accepted and ratio < p.gate * p.gate
    if accepted:
        for axis in range(2):
            fuse(m, passing[axis] - flow_row(m, r, velocity, axis, distance), noise)
    record_gate_result(m, FLOW, accepted, nis)
    return apply_correction(s)
