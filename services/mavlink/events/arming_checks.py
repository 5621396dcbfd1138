"""Sensor health and arming checks: libevents' protocol "health_and_arming_check".

A report is a summary of the arming checks, an event for each failed check, and a summary of the sensors' health.
"""

from collections.abc import Iterator

from lapwing.services.common import status_texts
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.events.definition import (
    PROTOCOL,
    Argument,
    Definition,
    Entry,
    Enumeration,
    Occurrence,
    detector,
    event,
)
from lapwing.services.mavlink.telemetry.system_status import healthy, sensor_health
from lapwing.services.mavlink.vehicle_cache import VehicleCache

INTERVAL = 1_000_000_000  # [ns] between two checks of the sensors
WITHOUT_POSITION = ("altitude_control", "stabilized", "acro")  # modes that need no position
MODES = tuple(dict.fromkeys(mode.kind for mode in firmware.get("px4").MODES))
_GPS = ("gps", "GPS")
_OF_SOURCE = {  # PX4's names
    "imu": ("gyro", "Gyroscope and accelerometer"),
    "gps": _GPS,
    "gps_velocity": _GPS,
    "barometer": ("absolute_pressure", "Absolute pressure"),
    "sonar": ("distance_sensor", "Distance sensor"),
    "magnetometer": ("magnetometer", "Magnetometer"),
    "optical_flow": ("optical_flow", "Optical flow"),
    "airspeed": ("differential_pressure", "Differential pressure"),
}
SOURCES = tuple(_OF_SOURCE)
_COMPONENTS = tuple(
    dict.fromkeys(
        (
            ("none", "None"),
            *_OF_SOURCE.values(),
            ("battery", "Battery"),
            ("attitude_estimate", "Attitude estimate"),
            ("local_position_estimate", "Local position estimate"),
        )
    )
)
_INDEX = {name: k for k, (name, _) in enumerate(_COMPONENTS)}
GROUPS = Enumeration(
    "navigation_mode_group_t", "uint32_t",
    tuple(Entry(1 << k, mode, mode.replace("_", " ")) for k, mode in enumerate(MODES)), bits=True,
)  # fmt: skip
_HEALTH = Enumeration(
    "health_component_t", "uint32_t",
    tuple(Entry(1 << k, name, text) for k, (name, text) in enumerate(_COMPONENTS)), bits=True,
)  # fmt: skip
_SOURCE = Enumeration(
    "source_t", "uint8_t", tuple(Entry(k, source, source.replace("_", " ")) for k, source in enumerate(SOURCES))
)  # fmt: skip
_ALL = (1 << len(MODES)) - 1
_chunk = Argument("chunk_idx", "uint8_t")

CHECKS = event(
    "arming_check_summary", "arming", "Summary of the arming checks", _chunk, Argument("error", _HEALTH),
    Argument("warning", _HEALTH), Argument("can_arm", GROUPS), Argument("can_run", GROUPS),
    level=PROTOCOL, group="arming_check", type_="summary",
)  # fmt: skip
HEALTH = event(
    "health_summary", "arming", "Summary of the health", _chunk, Argument("is_present", _HEALTH),
    Argument("error", _HEALTH), Argument("warning", _HEALTH), level=PROTOCOL, group="health", type_="summary",
)  # fmt: skip


def _check(name: str, message: str, *more: Argument) -> Definition:
    arguments = Argument("modes", GROUPS), Argument("health_component_index", "uint8_t"), *more
    return event(name, "arming", message, *arguments, level=mavlink.MAV_SEVERITY_ERROR, group="arming_check")


READINGS = _check("check_readings", "No good readings of the {3}", Argument("source", _SOURCE))
FAILED = {  # event and component by the beginning of the reason
    status_texts.NOT_STARTED: (_check("check_started", "The estimator has not started"), "attitude_estimate"),
    status_texts.POSITION_UNCERTAIN: (_check("check_position", "The position is uncertain"), "local_position_estimate"),
    status_texts.ATTITUDE_UNCERTAIN: (_check("check_attitude", "The attitude is uncertain"), "attitude_estimate"),
    status_texts.NOT_LEVEL: (_check("check_level", "The vehicle is not level"), "none"),
    status_texts.BATTERY_LOW: (_check("check_battery", "The battery is low"), "battery"),
    status_texts.OUTSIDE_FENCE: (_check("check_fence", "The vehicle is outside the fence"), "none"),
    status_texts.IN_KEEP_OUT: (_check("check_keep_out", "The vehicle is in a keep-out area"), "none"),
}
OTHER = _check("check_other", "The vehicle cannot be armed"), "none"
_READINGS = {status_texts.NO_READINGS.format(source): source for source in SOURCES}


@detector
class ArmingDetector:
    """Detector of changed arming checks, which also reports to new endpoints."""

    def __init__(self) -> None:
        self._announced: tuple = ()  # values whose change is reported immediately
        self._reported: tuple = ()
        self._next = 0  # [ns]

    def step(self, v: VehicleCache) -> Iterator[Occurrence]:
        """Yield the next report if one is due."""
        current = v.report_requests, tuple(v.status.arming_blockers)
        if current == self._announced and v.time_ns < self._next:
            return
        self._next = v.time_ns + INTERVAL
        health = tuple((source, is_valid) for source, _, is_valid in sensor_health(v))
        report = *current, healthy(v), health
        if report != self._reported:
            self._announced, self._reported = current, report
            yield from _report(current[1], healthy(v), health)


def _report(
    reasons: tuple[str, ...], position_known: bool, health: tuple[tuple[str, bool], ...]
) -> Iterator[Occurrence]:
    failed = [_failed_check(reason) for reason in reasons]
    wrong = sum({1 << values[1] for _, values in failed})
    can_arm = 0 if failed else _ALL
    can_run = _ALL if position_known else sum(1 << MODES.index(mode) for mode in WITHOUT_POSITION)
    yield CHECKS, (0, wrong, 0, can_arm, can_run)
    yield from failed
    present = sum({1 << _component(source) for source, _ in health})
    invalid = sum({1 << _component(source) for source, is_valid in health if not is_valid})
    yield HEALTH, (0, present, invalid, 0)


def _failed_check(reason: str) -> tuple:
    """Return the event of a failed check and the values of its arguments."""
    if source := _READINGS.get(reason):
        return READINGS, (_ALL, _component(source), SOURCES.index(source))
    definition, component = next(
        (event_entry for text, event_entry in FAILED.items() if reason.startswith(text)), OTHER
    )
    return definition, (_ALL, _INDEX[component])


def _component(source: str) -> int:
    return _INDEX[_OF_SOURCE[source][0]]
