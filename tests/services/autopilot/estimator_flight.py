"""Smooth flight with exact derivatives, measured by the sensor models and tracked by the estimator, all compiled."""

import math
from typing import NamedTuple

import numpy as np

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.noise import TURN_ON, normal3, stream_key
from lapwing.dynamics.vector import ZERO, cross, norm, scale
from lapwing.kernels import always_inline, kernel
from lapwing.services.autopilot import estimator
from lapwing.services.sensors import barometer, gps, imu, magnetometer, sonar
from lapwing.services.sensors.delay_line import Fault
from lapwing.services.sensors.fault_schedule import SLOTS
from lapwing.services.sensors.schema import sensors
from lapwing.services.sensors.sensor_inputs import Rotors, Truth

INTERVAL = 0.004  # [s]
STAND = 3.0  # [s] at rest on the ground before the flight
REST = 0.35  # [m] height of the body's origin on the ground
ENVIRONMENT, ROTORS = STANDARD._replace(gravity=9.81), Rotors()
THETA, V, P = slice(0, 3), slice(3, 6), slice(6, 9)  # columns of the error: rotation vector, velocity, position
NIS, HEALTH, REJECTED, COVARIANCE = 9, 15, 16, 17
COLUMNS = COVARIANCE + 81


@always_inline
def bump(amplitude, frequency, t):
    """Return amplitude (1 - cos)^2 and its first two derivatives: starts at rest, without a step in acceleration."""
    c, s = math.cos(frequency * t), math.sin(frequency * t)
    return (
        amplitude * (1.0 - c) ** 2,
        2.0 * amplitude * frequency * (1.0 - c) * s,
        2.0 * amplitude * frequency**2 * (s * s + (1.0 - c) * c),
    )


@always_inline
def attitude_at(t, agility):
    """Return the attitude with body z along the thrust of the path and a smooth yaw."""
    tau = max(t - STAND, 0.0)
    ax, ay, az = (bump(1.2, 0.8 * agility, tau)[2], bump(0.9, 0.7 * agility, tau)[2], bump(2.4, 0.35 * agility, tau)[2])
    f = (ax, ay, az + 9.81)
    up = scale(1.0 / norm(f), f)
    yaw = bump(0.5, 0.3, tau)[0]
    left = cross(up, (math.cos(yaw), math.sin(yaw), 0.0))
    left = scale(1.0 / norm(left), left)
    forth = cross(left, up)
    return quaternion.from_matrix((forth[0], left[0], up[0], forth[1], left[1], up[1], forth[2], left[2], up[2]))


@kernel
def truth_at(t, agility):
    """Return the true state at a time [s]; agility 1 tilts by about 20 degrees."""
    tau = max(t - STAND, 0.0)
    x = bump(1.2, 0.8 * agility, tau)
    y = bump(0.9, 0.7 * agility, tau)
    z = bump(2.4, 0.35 * agility, tau)
    h = 1e-4
    step = quaternion.multiply(quaternion.conjugate(attitude_at(t - h, agility)), attitude_at(t + h, agility))
    omega = scale(0.5 / h, quaternion.log(step))
    return Truth(
        (x[0], y[0], REST + z[0]),
        attitude_at(t, agility),
        (x[1], y[1], z[1]),
        omega,
        (x[2], y[2], z[2]),
        ZERO,
        REST + z[0],
        (x[1], y[1], z[1]),
        1.225,
        ROTORS,
        ENVIRONMENT,
    )


@kernel
def fly(p, memory, instruments, keys, ticks, agility, start, use_velocity, out):
    """Fly and write one row per GPS period. Return the last estimate."""
    imu_p, mag_p, gps_p, baro_p, sonar_p = instruments
    imu_k, mag_k, gps_k, baro_k, sonar_k = keys
    truth = truth_at(0.0, agility)
    imu_s = imu.initial(imu_p, imu_k, truth)
    mag_s = magnetometer.initial(mag_p, mag_k, truth)
    gps_s = gps.initial(gps_p, gps_k, truth)
    baro_s = barometer.initial(baro_p, baro_k, truth)
    sonar_s = sonar.initial(sonar_p, sonar_k, truth)
    imu_s, i = imu.sample(imu_p, imu_s, imu_k, -2, truth)
    mag_s, m = magnetometer.sample(mag_p, mag_s, mag_k, -2, truth)
    s = estimator.initial(p, memory, start, i.specific_force_body, m.field_body)
    for tick in range(ticks):
        t = tick * INTERVAL
        truth = truth_at(t, agility)
        imu_s, i = imu.sample(imu_p, imu_s, imu_k, tick, truth)
        s = estimator.predict(
            p, s, i.omega_body, i.specific_force_body, i.omega_variance, i.specific_force_variance, i.valid
        )
        if t < STAND - 0.1 and tick % 10 == 0:
            s = estimator.update_standstill(p, s, i.omega_variance, i.specific_force_variance)
        if tick % 5 == 0:
            mag_s, m = magnetometer.sample(mag_p, mag_s, mag_k, tick, truth)
            s = estimator.update_magnetometer(p, s, m.field_body, m.variance, m.valid)
            baro_s, b = barometer.sample(baro_p, baro_s, baro_k, tick, truth)
            s = estimator.update_barometer(p, s, b.pressure, b.variance, b.valid)
        if tick % 25 == 0:
            gps_s, g = gps.sample(gps_p, gps_s, gps_k, tick, truth)
            age = round(g.age / INTERVAL)
            s = estimator.update_gps(p, s, g.latitude_deg, g.longitude_deg, g.height, g.position_variance, age, g.valid)
            if use_velocity:
                s = estimator.update_gps_velocity(p, s, g.velocity_world, g.velocity_variance, age, g.valid)
            sonar_s, d = sonar.sample(sonar_p, sonar_s, sonar_k, tick, truth)
            s = estimator.update_sonar(p, s, d.range, d.variance, d.valid)
            write(out[tick // 25], p, s, truth)
    return estimator.estimate(p, s)


@always_inline
def write(row, p, s, truth):
    """Write the present errors and their consistency."""
    n = s.nominal
    error = quaternion.log(quaternion.multiply(truth.attitude, quaternion.conjugate(n.attitude)))
    for k in range(3):
        row[k] = error[k]
        row[3 + k] = truth.velocity_world[k] - n.velocity_world[k]
        row[6 + k] = truth.position_world[k] - n.position_world[k]
    for k in range(6):
        row[NIS + k] = s.memory.nis[k]
    for k in range(9):
        for j in range(9):
            row[COVARIANCE + 9 * k + j] = s.memory.covariance[k, j]
    e = estimator.estimate(p, s)
    row[HEALTH] = e.health
    row[REJECTED] = e.rejected


NO_FAULTS = (Fault(),) * SLOTS  # empty slots, so that flights with and without faults share their machine code
NAMES = ("imu", "magnetometer", "gps", "barometer", "sonar")


def sensor_parameters(**presets):
    """Return the parameters of the sensors; by default those of the default scene."""
    chosen = {name: next(iter(sensors()[name].PRESETS.values())) for name in NAMES} | presets
    return tuple(p if p.faults else p._replace(faults=NO_FAULTS) for p in chosen.values())


DEFAULT = sensor_parameters()


class Flight(NamedTuple):
    """Records of a flight at 10 Hz."""

    error: np.ndarray  # (n, 9) rotation vector [rad], velocity [m/s], position [m]: truth minus estimate
    covariance: np.ndarray  # (n, 9, 9) the filter's covariance of these errors
    nis: np.ndarray  # (n, 6)
    health: np.ndarray  # (n,)
    rejected: np.ndarray  # (n,)

    @property
    def nees(self):
        """Return the normalised estimation error squared (n,)."""
        return np.einsum("...i,...i", self.error, np.linalg.solve(self.covariance, self.error[..., None])[..., 0])

    @property
    def std(self):
        """Return the standard deviations (n, 9)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def flight(seed=1, instruments=DEFAULT, p=estimator.PRESETS["rtk"], duration=40.0, agility=1.0, velocity=True):
    """Return the record of a flight."""
    ticks = round(duration / INTERVAL)
    out = np.zeros((ticks // 25, COLUMNS))
    keys = tuple(stream_key(seed, "drone1", name) for name in NAMES)
    draw = normal3(keys[0], TURN_ON, 999)  # the initial errors have the filter's initial deviations
    guess = (p.start_std * draw[0], p.start_std * draw[1], REST + p.start_std * draw[2])
    fly(p, estimator.new_memory(), instruments, keys, ticks, agility, guess, velocity, out)
    covariance = out[:, COVARIANCE:].reshape(-1, 9, 9)
    return Flight(out[:, :9], covariance, out[:, NIS:HEALTH], out[:, HEALTH].astype(int), out[:, REJECTED].astype(int))
