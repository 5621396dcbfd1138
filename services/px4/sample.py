"""Conversion of port readings to messages of PX4's simulator interface; each reading is sent once.

Compiled code writes HIL_SENSOR at every step (`sensors`), Python the less frequent messages (`rare_messages`).
"""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.kernels import always_inline, math, python_function
from lapwing.services.common import ports
from lapwing.services.common.firmware.exchange import newest
from lapwing.services.common.firmware.link import Read
from lapwing.services.px4.framing import Layout
from lapwing.services.px4.messages import DISTANCE_SENSOR, HIL_GPS, distance_values, gps_values
from lapwing.services.px4.resolve import Px4Setup
from lapwing.services.px4.sensor_frame import NONE, Sensors

DITHER = 0.02  # [m/s^2], and 2e-3 rad/s: variation of the readings at rest, since PX4 rejects constant ones
RARE = (ports.GPS, ports.RANGEFINDER, ports.SONAR)  # ports whose messages Python writes
_IMU, _MAGNETOMETER, _BAROMETER, _AIRSPEED = range(4)


class Readings(NamedTuple):
    """Rings and periods of the ports of HIL_SENSOR."""

    imu: InputRing
    magnetometer: InputRing
    barometer: InputRing
    airspeed: InputRing
    periods: Any  # (n,) int64 [ticks] period of these ports, then of those in RARE; 0: none
    step: int  # [ticks] between two exchanges


@always_inline
def is_new(period: int, step: int, tick: int) -> bool:
    """Return True if a port of this period [ticks] has a reading later than the exchange `step` ticks ago."""
    return period > 0 and tick % period < step


@always_inline
def has_rare(p: Readings, tick: int) -> bool:
    """Return True if a port in RARE has a reading that has not been sent."""
    result = False
    for k in range(_AIRSPEED + 1, len(p.periods)):
        result = result or is_new(p.periods[k], p.step, tick)
    return result


@always_inline
def sensors(p: Readings, tick: int) -> Sensors:
    """Return the new readings of HIL_SENSOR."""
    imu, magnetometer = newest(p.imu, tick), newest(p.magnetometer, tick)
    barometer, airspeed = newest(p.barometer, tick), newest(p.airspeed, tick)
    omega = force = field = NONE
    pressure = dynamic = math.nan
    if is_new(p.periods[_IMU], p.step, tick) and imu.valid:
        omega, force = imu.omega_body, imu.specific_force_body
    if is_new(p.periods[_MAGNETOMETER], p.step, tick) and magnetometer.valid:
        field = magnetometer.field_body
    if is_new(p.periods[_BAROMETER], p.step, tick) and barometer.valid:
        pressure = barometer.pressure
    if is_new(p.periods[_AIRSPEED], p.step, tick) and airspeed.valid:
        dynamic = airspeed.pressure
    return Sensors(omega, force, field, pressure, dynamic)


def rare_messages(own: Px4Setup, step: int, tick: int, time_us: int, read: Read) -> list[tuple[Layout, tuple]]:
    """Return the messages of the ports in RARE at a tick; `step`: see `Readings`."""
    result = []
    for port in RARE:
        if not python_function(is_new)(own.periods.get(port, 0), step, tick):
            continue
        reading = read(port)
        if port == ports.GPS:
            result.append((HIL_GPS, gps_values(time_us, reading)))
        elif reading.valid and math.isfinite(reading.range):
            result.append((DISTANCE_SENSOR, distance_values(time_us, reading)))
    return result


def at_rest(own: Px4Setup, count: int) -> Sensors:
    """Return the `count`-th readings of a vehicle that rests at its start, before the run begins."""
    dither = DITHER * (count * 7 % 5 - 2)
    x, y, z = own.force_body
    rates = (0.1 * dither, -0.1 * dither, 0.05 * dither)
    field = own.field_body if count % 5 == 0 else NONE
    pressure = own.pressure + 50.0 * dither if count % 5 == 0 else math.nan
    return Sensors(rates, (x + dither, y - dither, z + dither), field, pressure)
