"""Readings of the ports as messages of PX4's simulator interface, each once."""

from lapwing.kernels import math
from lapwing.services.common import ports
from lapwing.services.common.firmware.link import Read
from lapwing.services.px4.framing import Layout
from lapwing.services.px4.messages import (
    DISTANCE_SENSOR,
    HIL_GPS,
    HIL_SENSOR,
    Sensors,
    distance_values,
    gps_values,
    sensor_values,
)
from lapwing.services.px4.resolve import Px4Setup

DITHER = 0.02  # [m/s^2] and 2e-3 rad/s of the readings at rest: PX4 rejects sensors that repeat their values


class Sampler:
    """Selects the readings that are new at a tick."""

    def __init__(self, own: Px4Setup):
        """Create a sampler before the first tick."""
        self._own = own
        self._stamps = dict.fromkeys(own.periods, -1)  # [ticks] of the last reading, by port

    def messages(self, tick: int, time_us: int, read: Read) -> tuple[list[tuple[Layout, tuple]], bool]:
        """Return the messages at a tick, and whether they have rates, without which PX4 sends no outputs."""
        new = {port for port in self._own.periods if self._is_new(port, tick)}
        omega = force = field = pressure = dynamic = None
        if ports.IMU in new and (imu := read(ports.IMU)).valid:
            omega, force = imu.omega_body, imu.specific_force_body
        if ports.MAGNETOMETER in new and (magnetometer := read(ports.MAGNETOMETER)).valid:
            field = magnetometer.field_body
        if ports.BAROMETER in new and (barometer := read(ports.BAROMETER)).valid:
            pressure = barometer.pressure
        if ports.AIRSPEED in new and (airspeed := read(ports.AIRSPEED)).valid:
            dynamic = airspeed.pressure
        result = [(HIL_SENSOR, sensor_values(time_us, Sensors(omega, force, field, pressure, dynamic)))]
        if ports.GPS in new:
            result.append((HIL_GPS, gps_values(time_us, read(ports.GPS))))
        for port in (ports.RANGEFINDER, ports.SONAR):
            if port in new and (reading := read(port)).valid and math.isfinite(reading.range):
                result.append((DISTANCE_SENSOR, distance_values(time_us, reading)))
        return result, omega is not None

    def _is_new(self, port: str, tick: int) -> bool:
        stamp = tick - tick % self._own.periods[port]
        if stamp == self._stamps[port]:
            return False
        self._stamps[port] = stamp
        return True


def at_rest(own: Px4Setup, count: int, time_us: int) -> list[tuple[Layout, tuple]]:
    """Return the `count`-th message of a vehicle that rests at its start, before the run begins."""
    dither = DITHER * (count * 7 % 5 - 2)
    x, y, z = own.force_body
    rates = (0.1 * dither, -0.1 * dither, 0.05 * dither)
    field = own.field_body if count % 5 == 0 else None
    pressure = own.pressure + 50.0 * dither if count % 5 == 0 else None
    sensors = Sensors(rates, (x + dither, y - dither, z + dither), field, pressure)
    return [(HIL_SENSOR, sensor_values(time_us, sensors))]
