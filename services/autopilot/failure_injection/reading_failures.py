"""Failures of sensor readings by reading class."""

from collections.abc import Callable
from typing import Any, NamedTuple

from lapwing.dynamics.noise import Key
from lapwing.kernels import DispatchTable, always_inline
from lapwing.services.autopilot.failure_injection.failure_state import garbage
from lapwing.services.common.ports import (
    AirspeedReading,
    BarometerReading,
    DistanceReading,
    GpsReading,
    MagnetometerReading,
    OpticalFlowReading,
)

EXCESS_PRESSURE = 500.0  # [Pa] error of a wrong barometer, about 40 m
EXCESS_RANGE = 1.5  # [m] error of a wrong distance sensor
EXCESS_FLOW = 0.5  # [rad/s] error of a wrong camera about x, 2 m/s at 4 m
EXCESS_DYNAMIC = 100.0  # [Pa] error of a wrong airspeed sensor, 13 m/s at rest
NORTH = 1e-3  # [deg] error of a wrong receiver, about 110 m
PRESSURES, RANGES = 2e5, 100.0  # [Pa], [m] upper ends of garbage from 0
FIELDS, HEIGHTS, SPEEDS = 1e-3, 1e4, 100.0  # [T], [m], [m/s] ranges of garbage, both signs
FLOWS, DYNAMICS = 10.0, 1500.0  # [rad/s], [Pa] ranges of garbage, both signs


class Failure(NamedTuple):
    """Failures of one kind of sensor."""

    field: str  # field of `Faults` with the failure type
    wrong: Callable[[Any], Any]  # wrong reading
    garbage: Callable[[Any, Key, int], Any]  # random reading at a tick


@always_inline
def _wrong_barometer(r: BarometerReading) -> BarometerReading:
    return BarometerReading(r.pressure + EXCESS_PRESSURE, r.variance, r.valid)


@always_inline
def _garbage_barometer(r: BarometerReading, key: Key, tick: int) -> BarometerReading:
    return BarometerReading(abs(garbage(key, tick, 0, PRESSURES)[0]), r.variance, r.valid)


@always_inline
def _wrong_distance(r: DistanceReading) -> DistanceReading:
    return DistanceReading(r.range + EXCESS_RANGE, r.variance, r.valid)


@always_inline
def _garbage_distance(r: DistanceReading, key: Key, tick: int) -> DistanceReading:
    return DistanceReading(abs(garbage(key, tick, 0, RANGES)[0]), r.variance, r.valid)


@always_inline
def _wrong_flow(r: OpticalFlowReading) -> OpticalFlowReading:
    return OpticalFlowReading((r.flow[0] + EXCESS_FLOW, r.flow[1]), r.rate, r.distance, r.variance, r.valid)


@always_inline
def _garbage_flow(r: OpticalFlowReading, key: Key, tick: int) -> OpticalFlowReading:
    x, y, _ = garbage(key, tick, 0, FLOWS)
    return OpticalFlowReading((x, y), r.rate, r.distance, r.variance, r.valid)


@always_inline
def _wrong_airspeed(r: AirspeedReading) -> AirspeedReading:
    return AirspeedReading(r.pressure + EXCESS_DYNAMIC, r.variance, r.valid)


@always_inline
def _garbage_airspeed(r: AirspeedReading, key: Key, tick: int) -> AirspeedReading:
    return AirspeedReading(garbage(key, tick, 0, DYNAMICS)[0], r.variance, r.valid)


@always_inline
def _wrong_magnetometer(r: MagnetometerReading) -> MagnetometerReading:
    return MagnetometerReading((-r.field_body[1], r.field_body[0], r.field_body[2]), r.variance, r.valid)  # by 90 deg


@always_inline
def _garbage_magnetometer(r: MagnetometerReading, key: Key, tick: int) -> MagnetometerReading:
    return MagnetometerReading(garbage(key, tick, 0, FIELDS), r.variance, r.valid)


@always_inline
def _wrong_gps(r: GpsReading) -> GpsReading:
    return GpsReading(
        r.latitude_deg + NORTH, r.longitude_deg, r.height, r.position_variance,
        r.velocity_world, r.velocity_variance, r.age, r.valid, r.fix, r.used, r.visible, r.hdop, r.vdop,
    )  # fmt: skip


@always_inline
def _garbage_gps(r: GpsReading, key: Key, tick: int) -> GpsReading:
    x, y, z = garbage(key, tick, 0, 1.0)
    return GpsReading(
        90.0 * x, 180.0 * y, HEIGHTS * z, r.position_variance,
        garbage(key, tick, 1, SPEEDS), r.velocity_variance, r.age, r.valid, r.fix, r.used, r.visible, r.hdop, r.vdop,
    )  # fmt: skip


FAILURES = DispatchTable()
"""Failures by reading class."""
FAILURES[BarometerReading] = Failure("barometer", _wrong_barometer, _garbage_barometer)
FAILURES[DistanceReading] = Failure("distance_sensor", _wrong_distance, _garbage_distance)
FAILURES[MagnetometerReading] = Failure("magnetometer", _wrong_magnetometer, _garbage_magnetometer)
FAILURES[GpsReading] = Failure("gps", _wrong_gps, _garbage_gps)
FAILURES[OpticalFlowReading] = Failure("optical_flow", _wrong_flow, _garbage_flow)
FAILURES[AirspeedReading] = Failure("airspeed", _wrong_airspeed, _garbage_airspeed)
