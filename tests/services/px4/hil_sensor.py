"""HIL_SENSOR by `struct`, independent of the compiled packing of the adapter."""

import math
from typing import NamedTuple

from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.services.px4.messages import ACCELEROMETER, AIRSPEED, BAROMETER, GYRO, MAGNETOMETER, TEMPERATURE


class Sensors(NamedTuple):
    """Readings of one step, body FLU; None: not updated."""

    omega_body: Vec3 | None = None  # [rad/s]
    specific_force_body: Vec3 | None = None  # [m/s^2]
    field_body: Vec3 | None = None  # [T]
    pressure: float | None = None  # [Pa]
    dynamic_pressure: float | None = None  # [Pa]


def sensor_values(time_us: int, s: Sensors, identifier: int = 0) -> tuple:
    """Return the values of HIL_SENSOR: FRD, gauss and hPa; `identifier` 0 sets PX4's clock."""
    mask = 0
    gyro = force = field = ZERO
    pressure = dynamic = 0.0
    if s.specific_force_body is not None:
        (x, y, z), mask = s.specific_force_body, mask | ACCELEROMETER
        force = (x, -y, -z)
    if s.omega_body is not None:
        (x, y, z), mask = s.omega_body, mask | GYRO
        gyro = (x, -y, -z)
    if s.field_body is not None:
        (x, y, z), mask = s.field_body, mask | MAGNETOMETER
        field = (1e4 * x, -1e4 * y, -1e4 * z)
    altitude = 0.0
    if s.pressure is not None:
        pressure, mask = 0.01 * s.pressure, mask | BAROMETER
        altitude = pressure_altitude(s.pressure)
    if s.dynamic_pressure is not None:
        dynamic, mask = 0.01 * s.dynamic_pressure, mask | AIRSPEED
    return time_us, *force, *gyro, *field, pressure, dynamic, altitude, TEMPERATURE, mask, identifier


def pressure_altitude(pressure: float) -> float:
    """Return the altitude [m] in the International Standard Atmosphere (below 11 km) of a pressure [Pa]."""
    return 44330.77 * (1.0 - math.pow(max(pressure, 0.0) / 101325.0, 0.190263))
