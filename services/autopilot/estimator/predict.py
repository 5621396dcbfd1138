"""Prediction by IMU readings (theory, eqs. (3.21) to (3.24))."""

from lapwing.dynamics.lie.quaternion import exp, multiply, normalise, rotation_matrix
from lapwing.dynamics.vector import Vec3, add, apply, norm, scale, subtract
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.estimator.covariance_propagation import fade, propagate_considered, propagate_covariance
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    ACCELEROMETER,
    BAROMETER,
    GYRO,
    HISTORY,
    IMU,
    IRON,
    THETA,
    VELOCITY,
    WANDER,
    WATCHED,
    Inertial,
    Nominal,
    State,
    warm_up_left,
)
from lapwing.services.autopilot.estimator.measurement_checks import is_stuck
from lapwing.services.autopilot.estimator.static_pressure import decorrelate_gusts

_LINEAR = 0.1  # fraction of a jolt up to which the change between two readings counts as linear
_IMPACT = 0.5  # [m/s] change of velocity that may hide between two readings
_REBOUND = 12.0  # [m^2/s^3] variance rate of the velocity after motor stop: 0.7 m/s after a drop of 40 ms
_TIPPING = 2.5e-3  # [rad^2/s] variance rate of the attitude after motor stop
_BOUNCE = 1.0  # [s] after which the vehicle rests


@always_inline
def _is_spike(p: Estimator, i: Inertial, omega: Vec3, force: Vec3) -> bool:
    """Return True for a spike: a jump from an accepted reading."""
    return not i.spike and (
        norm(subtract(omega, i.omega)) > p.jolt_rate or norm(subtract(force, i.force)) > p.jolt_force
    )


@always_inline
def _process_noise(
    p: Estimator,
    q_theta: float,
    q_velocity: float,
    twist: float,
    jolt: float,
    first: bool,
    spike: bool,
    cut_readings: int,
    reused: bool,
) -> tuple[float, float]:
    """Return the variances of attitude [rad^2] and velocity [(m/s)^2] that an interval adds.

    Args:
        p: `Estimator`.
        q_theta: variance by the gyroscopes' white noise [rad^2].
        q_velocity: variance by the accelerometers' white noise [(m/s)^2].
        twist: change between two gyroscope readings [rad/s].
        jolt: change between two accelerometer readings [m/s^2].
        first: True for the first reading.
        spike: True if the reading is rejected as a spike.
        cut_readings: readings since the motors stopped over the ground; 0: running.
        reused: True if the previous reading is used again.
    """
    dt = p.interval
    if not first:  # error of the trapezoidal rule between distant readings
        q_theta += math.square(dt * max(twist - _LINEAR * p.jolt_rate, 0.0) / 6.0)
        q_velocity += math.square(dt * max(jolt - _LINEAR * p.jolt_force, 0.0) / 6.0)
    if not first and (jolt > p.jolt_force or spike):  # an impact on the ground is shorter than the interval
        q_velocity += math.square(max(0.5 * dt * jolt, _IMPACT))
    if not first and (twist > p.jolt_rate or spike):
        q_theta += math.square(0.5 * dt * twist)
    if 0 < cut_readings * dt < _BOUNCE:  # the vehicle drops, and an impact may be shorter than the interval
        q_velocity += dt * _REBOUND * math.square(math.square(1.0 - cut_readings * dt / _BOUNCE))
        q_theta += dt * _TIPPING * math.square(math.square(1.0 - cut_readings * dt / _BOUNCE))
    if reused:  # error of reused readings during a manoeuvre
        q_velocity += dt * 1.0
        q_theta += dt * 0.1
    return q_theta, q_velocity


@kernel
def predict(
    p: Estimator,
    s: State,
    omega_body: Vec3,
    specific_force_body: Vec3,
    omega_variance: float,
    specific_force_variance: float,
    valid: bool,
    cut: bool = False,
) -> State:
    """Return the state one interval later.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        omega_body: [rad/s] reading of the gyroscopes now.
        specific_force_body: [m/s^2] reading of the accelerometers now.
        omega_variance: [(rad/s)^2] per axis.
        specific_force_variance: [(m/s^2)^2] per axis.
        valid: False without a reading; the last one is reused.
        cut: True once the motors have stopped for the landing.
    """
    n, i, m = s.nominal, s.inertial, s.memory
    dt = p.interval
    first = i.tick == 0
    frozen = valid and is_stuck(m, IMU, omega_body, specific_force_body, omega_variance > 0.0, p.frozen)
    spike = valid and not first and _is_spike(p, i, omega_body, specific_force_body)
    usable = valid and not spike and not frozen
    omega = omega_body if usable else i.omega
    force = specific_force_body if usable else i.force
    omega_before = omega if first else i.omega

    # Trapezoidal rule in the world frame: the readings belong to both ends of the interval.
    omega_mean = subtract(scale(0.5, add(omega_before, omega)), n.gyro_bias)
    attitude = normalise(multiply(n.attitude, exp(scale(dt, omega_mean))))
    r0, r = rotation_matrix(n.attitude), rotation_matrix(attitude)
    f0 = apply(r0, subtract(i.force, n.accelerometer_bias))
    f1 = apply(r, subtract(force, n.accelerometer_bias))
    a0, a1 = (f0[0], f0[1], f0[2] - p.gravity), (f1[0], f1[1], f1[2] - p.gravity)
    dv = scale(0.5 * dt, add(a0, a1))
    dd = scale(dt * dt / 6.0, add(scale(2.0, a0), a1))
    velocity = add(n.velocity_world, dv)
    position = add(n.position_world, add(scale(dt, n.velocity_world), dd))
    distance_gain = add(i.distance_gain, add(scale(dt, i.velocity_gain), dd))
    velocity_gain = add(i.velocity_gain, dv)
    tick = i.tick + 1
    for k in range(3):
        m.history[tick % HISTORY, k] = velocity_gain[k]
        m.history[tick % HISTORY, 3 + k] = distance_gain[k]

    c, force_mean = m.covariance, scale(0.5, add(f0, f1))
    propagate_covariance(c, force_mean, r, dt)
    drift = warm_up_left(p, i.tick) - warm_up_left(p, tick)
    propagate_considered(m, omega_mean, force_mean, r, drift, dt)
    keep = math.exp(-dt / p.gps_correlation_time)
    fade(m, keep)
    decorrelate_gusts(p, s)

    jolt = norm(subtract(specific_force_body, i.force))
    twist = norm(subtract(omega_body, i.omega))
    cut_readings = i.cut + 1 if cut else 0
    q_theta, q_velocity = _process_noise(
        p, dt * dt * omega_variance, dt * dt * specific_force_variance, twist, jolt, first, spike, cut_readings,
        not valid or frozen,
    )  # fmt: skip
    m.history[tick % HISTORY, 6] = q_velocity
    m.history[tick % HISTORY, 7] = q_theta
    for k in range(3):
        c[THETA + k, THETA + k] += q_theta
        c[VELOCITY + k, VELOCITY + k] += q_velocity
        c[GYRO + k, GYRO + k] += dt * (p.gyro_bias_walk * p.gyro_bias_walk)
        c[ACCELEROMETER + k, ACCELEROMETER + k] += dt * (p.accelerometer_bias_walk * p.accelerometer_bias_walk)
        deviation = p.gps_correlated_error_vertical if k == 2 else p.gps_correlated_error_horizontal
        c[WANDER + k, WANDER + k] += (1.0 - keep * keep) * (deviation * deviation)
        c[IRON + k, IRON + k] += dt * (p.magnetometer_bias_walk * p.magnetometer_bias_walk)
    c[BAROMETER, BAROMETER] += dt * (p.barometer_walk * p.barometer_walk)

    for k in range(WATCHED):
        if m.since[k] >= 0:
            m.since[k] += 1
    m.rejected[IMU] = 0 if usable else 1
    if usable:
        m.since[IMU] = 0
    nominal = Nominal(
        attitude,
        velocity,
        position,
        n.gyro_bias,
        n.accelerometer_bias,
        scale(keep, n.gps_correlated_error),
        n.magnetometer_bias,
        n.heading_bias,
        n.barometer_bias,
        n.sonar_scale,
    )
    return State(nominal, Inertial(tick, omega, force, f1, velocity_gain, distance_gain, spike, cut_readings), m)
