"""Long records of a sensor at rest, compiled, and their Allan deviation."""

import numpy as np

from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import geodetic_to_enu
from lapwing.dynamics.noise import stream_key
from lapwing.kernels import kernel
from lapwing.services.sensors import airspeed, barometer, gps, imu, magnetometer, optical_flow, rangefinder, sonar
from lapwing.services.sensors.sensor_inputs import Truth

REST = Truth(height_above_ground=2.0, environment=STANDARD._replace(gravity=9.81))


@kernel
def record_imu(p, key, truth, out):
    s = imu.initial(p, key, truth)
    for k in range(len(out)):
        s, r = imu.sample(p, s, key, k, truth)
        out[k, 0], out[k, 1], out[k, 2] = r.omega_body
        out[k, 3], out[k, 4], out[k, 5] = r.specific_force_body


@kernel
def record_magnetometer(p, key, truth, out):
    s = magnetometer.initial(p, key, truth)
    for k in range(len(out)):
        s, r = magnetometer.sample(p, s, key, k, truth)
        out[k, 0], out[k, 1], out[k, 2] = r.field_body


@kernel
def record_barometer(p, key, truth, out):
    s = barometer.initial(p, key, truth)
    for k in range(len(out)):
        s, r = barometer.sample(p, s, key, k, truth)
        out[k, 0] = r.pressure


@kernel
def record_sonar(p, key, truth, out):
    s = sonar.initial(p, key, truth)
    for k in range(len(out)):
        s, r = sonar.sample(p, s, key, k, truth)
        out[k, 0] = r.range


@kernel
def record_gps(p, key, truth, out):
    s = gps.initial(p, key, truth)
    for k in range(len(out)):
        s, r = gps.sample(p, s, key, k, truth)
        home = truth.environment.home
        out[k, 0], out[k, 1], out[k, 2] = geodetic_to_enu(home, r.latitude_deg, r.longitude_deg, r.height)
        out[k, 3], out[k, 4], out[k, 5] = r.velocity_world


@kernel
def record_rangefinder(p, key, truth, out):
    s = rangefinder.initial(p, key, truth)
    for k in range(len(out)):
        s, r = rangefinder.sample(p, s, key, k, truth)
        out[k, 0] = r.range


@kernel
def record_airspeed(p, key, truth, out):
    s = airspeed.initial(p, key, truth)
    for k in range(len(out)):
        s, r = airspeed.sample(p, s, key, k, truth)
        out[k, 0] = r.pressure


@kernel
def record_optical_flow(p, key, truth, out):
    s = optical_flow.initial(p, key, truth)
    for k in range(len(out)):
        s, r = optical_flow.sample(p, s, key, k, truth)
        out[k, 0], out[k, 1] = r.flow
        out[k, 2], out[k, 3] = r.rate


RECORD = {
    "imu": (record_imu, 6),
    "magnetometer": (record_magnetometer, 3),
    "barometer": (record_barometer, 1),
    "sonar": (record_sonar, 1),
    "gps": (record_gps, 6),
    "rangefinder": (record_rangefinder, 1),
    "airspeed": (record_airspeed, 1),
    "optical_flow": (record_optical_flow, 4),
}


def record(sensor, p, samples, seed=1, vehicle="drone1", truth=REST):
    """Return the readings (samples, channels) of a vehicle at rest."""
    function, width = RECORD[sensor]
    out = np.empty((samples, width))
    function(p, stream_key(seed, vehicle, sensor), truth, out)
    return out


def allan_deviation(x, m):
    """Return the overlapping Allan deviation of each column over clusters of m samples (IEEE Std 952, annex C)."""
    sums = np.cumsum(np.vstack([np.zeros(x.shape[1]), x - x.mean(axis=0)]), axis=0)
    mean = (sums[m:] - sums[:-m]) / m
    return np.sqrt(0.5 * np.mean((mean[m:] - mean[:-m]) ** 2, axis=0))


def rms_of_axes(deviations):
    """Return the root mean square over equal axes."""
    return float(np.sqrt(np.mean(np.square(deviations))))
