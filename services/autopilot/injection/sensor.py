"""Failures of a barometer, a sonar, a magnetometer or a satellite receiver, told apart by the class of the reading."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from cosim.part import GO_ON, Received
from dynamics.generate import define, implements
from dynamics.kernel import ByClass, leaf
from services.autopilot.injection.memory import Memory, silent
from services.common.failures import STUCK, WRONG, Faults
from services.common.ports import BarometerReading, GpsReading, MagnetometerReading, SonarReading

Reading = BarometerReading | GpsReading | MagnetometerReading | SonarReading

EXCESS_PRESSURE = 500.0  # [Pa] of a wrong barometer, which reads some 40 m too low
EXCESS_RANGE = 1.5  # [m] of a wrong sonar
NORTH = 1e-3  # [deg] of a wrong receiver, some 110 m


class SensorInjection(NamedTuple):
    """What is wrong."""

    faults: Any  # cell of `Faults`


class _Failure(NamedTuple):
    """Of one kind of sensor."""

    kind: Callable[[Faults], int]  # what is wrong with it
    wrong: Callable[[Any], Any]  # the reading of one that is wrong


@leaf
def _barometer_kind(faults: Faults) -> int:
    return faults.barometer


@leaf
def _wrong_barometer(r: BarometerReading) -> BarometerReading:
    return BarometerReading(r.pressure + EXCESS_PRESSURE, r.variance, r.valid)


@leaf
def _sonar_kind(faults: Faults) -> int:
    return faults.sonar


@leaf
def _wrong_sonar(r: SonarReading) -> SonarReading:
    return SonarReading(r.range + EXCESS_RANGE, r.variance, r.valid)


@leaf
def _magnetometer_kind(faults: Faults) -> int:
    return faults.magnetometer


@leaf
def _wrong_magnetometer(r: MagnetometerReading) -> MagnetometerReading:
    return MagnetometerReading((-r.field_body[1], r.field_body[0], r.field_body[2]), r.variance, r.valid)  # by 90 deg


@leaf
def _gps_kind(faults: Faults) -> int:
    return faults.gps


@leaf
def _wrong_gps(r: GpsReading) -> GpsReading:
    return GpsReading(
        r.latitude_deg + NORTH, r.longitude_deg, r.height, r.position_variance,
        r.velocity_world, r.velocity_variance, r.age, r.valid,
    )  # fmt: skip


FAILURES = ByClass()
"""The failures by the class of a reading."""
FAILURES[BarometerReading] = _Failure(_barometer_kind, _wrong_barometer)
FAILURES[SonarReading] = _Failure(_sonar_kind, _wrong_sonar)
FAILURES[MagnetometerReading] = _Failure(_magnetometer_kind, _wrong_magnetometer)
FAILURES[GpsReading] = _Failure(_gps_kind, _wrong_gps)


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


def lost(r: Reading) -> Reading:
    """The reading, as one that does not arrive."""
    raise NotImplementedError("compiled code only")


@implements(lost, inline=True)
def _lost_by(r: types.Type) -> Callable:
    kept = "".join(f"r.{field}, " for field in r.fields if field != "valid")  # `valid` is the last of every reading
    return define("lost(r)", {"Reading": r.instance_class}, f"return Reading({kept}False)")


@leaf
def step(p: SensorInjection, s: Memory, tick: int, inputs: tuple[Received, ...]) -> tuple[Memory, tuple, int]:
    """What arrives of the reading of the tick."""
    r = inputs[0].value
    kind = kind_of(p.faults.value, r)
    last = s.last if kind == STUCK else r
    x = last
    if kind == WRONG:
        x = wrong(r)
    if silent(kind, s.readings):
        x = lost(r)
    return Memory(last, s.readings + 1), (x,), GO_ON
