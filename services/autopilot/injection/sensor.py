"""Failures of a barometer, a sonar, a magnetometer or a satellite receiver, told apart by the class of the reading."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from cosim.part import GO_ON, Received
from dynamics.generate import define, implements
from dynamics.kernel import ByClass, leaf
from dynamics.noise import Key
from services.autopilot.injection.memory import Memory, garbage, silent
from services.common.failures import DELAYED, GARBAGE, STUCK, WRONG, Faults
from services.common.ports import BarometerReading, DistanceReading, GpsReading, MagnetometerReading

Reading = BarometerReading | DistanceReading | GpsReading | MagnetometerReading

EXCESS_PRESSURE = 500.0  # [Pa] of a wrong barometer, which reads some 40 m too low
EXCESS_RANGE = 1.5  # [m] of a wrong sonar
NORTH = 1e-3  # [deg] of a wrong receiver, some 110 m
PRESSURES, RANGES = 2e5, 100.0  # [Pa], [m] that garbage fills from 0 on
FIELDS, HEIGHTS, SPEEDS = 1e-3, 1e4, 100.0  # [T], [m], [m/s] that it fills to both sides


class SensorInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`
    key: Key  # of random numbers


class _Failure(NamedTuple):
    """Of one kind of sensor."""

    kind: Callable[[Faults], int]  # what is wrong with it
    wrong: Callable[[Any], Any]  # the reading of one that is wrong
    garbage: Callable[[Any, Key, int], Any]  # the reading with random numbers at a tick


@leaf
def _barometer_kind(faults: Faults) -> int:
    return faults.barometer


@leaf
def _wrong_barometer(r: BarometerReading) -> BarometerReading:
    return BarometerReading(r.pressure + EXCESS_PRESSURE, r.variance, r.valid)


@leaf
def _garbage_barometer(r: BarometerReading, key: Key, tick: int) -> BarometerReading:
    return BarometerReading(abs(garbage(key, tick, 0, PRESSURES)[0]), r.variance, r.valid)


@leaf
def _sonar_kind(faults: Faults) -> int:
    return faults.sonar


@leaf
def _wrong_sonar(r: DistanceReading) -> DistanceReading:
    return DistanceReading(r.range + EXCESS_RANGE, r.variance, r.valid)


@leaf
def _garbage_sonar(r: DistanceReading, key: Key, tick: int) -> DistanceReading:
    return DistanceReading(abs(garbage(key, tick, 0, RANGES)[0]), r.variance, r.valid)


@leaf
def _magnetometer_kind(faults: Faults) -> int:
    return faults.magnetometer


@leaf
def _wrong_magnetometer(r: MagnetometerReading) -> MagnetometerReading:
    return MagnetometerReading((-r.field_body[1], r.field_body[0], r.field_body[2]), r.variance, r.valid)  # by 90 deg


@leaf
def _garbage_magnetometer(r: MagnetometerReading, key: Key, tick: int) -> MagnetometerReading:
    return MagnetometerReading(garbage(key, tick, 0, FIELDS), r.variance, r.valid)


@leaf
def _gps_kind(faults: Faults) -> int:
    return faults.gps


@leaf
def _wrong_gps(r: GpsReading) -> GpsReading:
    return GpsReading(
        r.latitude_deg + NORTH, r.longitude_deg, r.height, r.position_variance,
        r.velocity_world, r.velocity_variance, r.age, r.valid,
    )  # fmt: skip


@leaf
def _garbage_gps(r: GpsReading, key: Key, tick: int) -> GpsReading:
    x, y, z = garbage(key, tick, 0, 1.0)
    return GpsReading(
        90.0 * x, 180.0 * y, HEIGHTS * z, r.position_variance,
        garbage(key, tick, 1, SPEEDS), r.velocity_variance, r.age, r.valid,
    )  # fmt: skip


FAILURES = ByClass()
"""The failures by the class of a reading."""
FAILURES[BarometerReading] = _Failure(_barometer_kind, _wrong_barometer, _garbage_barometer)
FAILURES[DistanceReading] = _Failure(_sonar_kind, _wrong_sonar, _garbage_sonar)
FAILURES[MagnetometerReading] = _Failure(_magnetometer_kind, _wrong_magnetometer, _garbage_magnetometer)
FAILURES[GpsReading] = _Failure(_gps_kind, _wrong_gps, _garbage_gps)


def kind_of(faults: Faults, r: Reading) -> int:
    """What is wrong with the sensor that gives `r`."""
    raise NotImplementedError("compiled code only")


@implements(kind_of, inline=True)
def _kind_by(faults: types.Type, r: types.Type) -> Callable:
    found = FAILURES[r.instance_class].kind
    return lambda faults, r: found(faults)


def wrong(r: Reading) -> Reading:
    """The reading of a sensor that is wrong."""
    raise NotImplementedError("compiled code only")


@implements(wrong, inline=True)
def _wrong_by(r: types.Type) -> Callable:
    found = FAILURES[r.instance_class].wrong
    return lambda r: found(r)


def nonsense(r: Reading, key: Key, tick: int) -> Reading:
    """The reading with random numbers at a tick."""
    raise NotImplementedError("compiled code only")


@implements(nonsense, inline=True)
def _nonsense_by(r: types.Type, key: types.Type, tick: types.Type) -> Callable:
    found = FAILURES[r.instance_class].garbage
    return lambda r, key, tick: found(r, key, tick)


def lost(r: Reading) -> Reading:
    """The reading, as one that does not arrive."""
    raise NotImplementedError("compiled code only")


@implements(lost, inline=True)
def _lost_by(r: types.Type) -> Callable:
    kept = "".join(f"r.{field}, " for field in r.fields if field != "valid")  # `valid` is the last of every reading
    return define("lost(r)", {"Reading": r.instance_class}, f"return Reading({kept}False)")


@leaf
def step(p: SensorInjection, s: Memory, tick: int, inputs: tuple[Received, ...]) -> tuple[Memory, tuple, int]:
    """What arrives of the reading of the tick; the second input is the same `DELAY` ago."""
    r, late = inputs[0].value, inputs[1]
    kind = kind_of(p.faults.value, r)
    last = s.last if kind == STUCK else r
    x = last
    if kind == WRONG:
        x = wrong(r)
    elif kind == GARBAGE:
        x = nonsense(r, p.key, tick)
    elif kind == DELAYED:
        x = late.value
    if silent(kind, p.key, 0, s.readings) or (kind == DELAYED and not late.due):
        x = lost(r)
    return Memory(last, s.readings + 1), (x,), GO_ON
