"""Output of a recording as a Lapwing log, with the topics of a simulated flight."""

import heapq
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.log import LogWriter
from lapwing.cosim.output_lock import write_errors
from lapwing.flights.log_import.recording import SEA_LEVEL, Recording, Series
from lapwing.messages.topics import (
    ACTUATORS,
    AIRSPEED,
    BARO,
    BATTERY,
    GPS,
    GPS_VELOCITY,
    IMU,
    MAG,
    OPTICAL_FLOW,
    RANGEFINDER,
    SETPOINT,
    STATUS,
    TRUTH,
    Topic,
)
from lapwing.messages.types import (
    Actuators,
    BatteryState,
    FluidPressure,
    Header,
    Imu,
    MagneticField,
    NavSatFix,
    NavSatStatus,
    OpticalFlow,
    Point,
    Pose,
    Quaternion,
    Range,
    Setpoint,
    Status,
    Time,
    Twist,
    TwistWithCovariance,
    TwistWithCovarianceStamped,
    Vector3,
    VehicleState,
)

VEHICLE = "drone1"
FRAME = "world"
BATTERY_INTERVAL = 0.1  # [s]
UNSET = Vector3(math.nan, math.nan, math.nan)
UNKNOWN_BATTERY = BatteryState(
    temperature=math.nan, charge=math.nan, capacity=math.nan, design_capacity=math.nan, percentage=math.nan,
    present=True,
)  # fmt: skip
MODES = {  # vehicle_status.nav_state of PX4
    0: "manual", 1: "altitude", 2: "position", 3: "mission", 4: "hold", 5: "return", 10: "acro", 12: "descend",
    13: "terminated", 14: "offboard", 15: "stabilized", 17: "takeoff", 18: "land", 19: "follow", 20: "precision land",
    21: "orbit",
}  # fmt: skip
ACCURACY, GEOID_HEIGHT = 5.0, 107.0  # [m] horizontal error of a receiver, largest distance of geoid and ellipsoid
SPINNING = 0.05  # motor voltage over its maximum above which motors count as armed


SENSORS: dict[str, tuple[Topic, Callable[[Header, Sequence[float]], Any]]] = {
    # topic and message of each sensor; values: imu [rad/s], [m/s^2] body; gps [deg], [m]; gps_velocity [m/s] world;
    # baro [Pa]; mag [T] body; rangefinder [m]; optical_flow [rad/s] of flow and camera about body x and y, [m];
    # airspeed [Pa]; status: armed, landed, failsafe, and the navigation state of PX4
    "imu": (
        IMU,
        lambda header, v: Imu(header=header, angular_velocity=Vector3(*v[:3]), linear_acceleration=Vector3(*v[3:])),
    ),
    "gps": (
        GPS,
        lambda header, v: NavSatFix(
            header, NavSatStatus(NavSatStatus.STATUS_FIX, NavSatStatus.SERVICE_GPS), v[0], v[1], v[2]
        ),
    ),
    "gps_velocity": (
        GPS_VELOCITY,
        lambda header, v: TwistWithCovarianceStamped(header, TwistWithCovariance(Twist(linear=Vector3(*v)))),
    ),
    "baro": (BARO, lambda header, v: FluidPressure(header, v[0])),
    "mag": (MAG, lambda header, v: MagneticField(header, Vector3(*v))),
    "rangefinder": (RANGEFINDER, lambda header, v: Range(header, Range.INFRARED, range=v[0])),
    "optical_flow": (
        OPTICAL_FLOW,
        lambda header, v: OpticalFlow(header, flow=tuple(v[:2]), rate=tuple(v[2:4]), distance=v[4], variance=math.nan),
    ),
    "airspeed": (AIRSPEED, lambda header, v: FluidPressure(header, v[0])),
    "status": (
        STATUS,
        lambda header, v: Status(
            header, MODES.get(int(v[3]), f"mode {v[3]:.0f}"), armed=v[0] > 0, landed=v[1] > 0, failsafe=v[2] > 0
        ),
    ),
}


def _fix_above_sea(header: Header, values: Sequence[float]) -> NavSatFix:
    """Return a fix whose height is that above mean sea level, with the distance of geoid and ellipsoid as its error."""
    covariance = np.diag([ACCURACY, ACCURACY, GEOID_HEIGHT]) ** 2
    return SENSORS["gps"][1](header, values)._replace(
        position_covariance=tuple(covariance.ravel().tolist()),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_APPROXIMATED,
    )


def write_log(path: Path, flight: Recording, source: str) -> None:
    """Write a recording as a log. The topics of the motion omit invalid samples; the metadata has their number.

    The log replaces `path` when it is complete; see `complete_file`.

    Args:
        path: path of the log.
        flight: recording.
        source: name of the imported file.
    """
    metadata = {
        "scene": flight.name,
        "mode": "imported",
        "vehicle": VEHICLE,
        "imported_from": source,
        "invalid_samples": str(int((~flight.valid).sum())),
        "altitude_datum": flight.readings["gps"].datum if "gps" in flight.readings else "",
        "faults": ", ".join(f"{cause}: {count}" for cause, count in flight.faults.items()),
        "notes": "; ".join(flight.notes),
        "unknown_topics": ", ".join(flight.unknown),
    }
    messages = heapq.merge(_motion(flight), *_readings(flight), key=lambda entry: entry[0])
    with write_errors(path), complete_file(path) as file:
        try:
            with LogWriter(file, metadata, {}) as log:
                for time_ns, topic, message in messages:
                    log.write(topic.key(VEHICLE), type(message), message.encode(), time_ns)
        except ValueError as error:
            raise ValueError(str(error).replace(str(file), str(path))) from None


def _motion(flight: Recording) -> Iterator[tuple[int, Topic, Any]]:
    """Yield (time [ns], topic, message) of the quantities on the flight's grid."""
    acceleration = np.gradient(flight.velocity, flight.interval, axis=0)
    highest = max(float(np.nanmax(flight.motor_voltage, initial=0.0)), 1e-9)
    measured = [values for values in (flight.position, flight.attitude) if np.isfinite(values).any()]
    known = np.isfinite(np.column_stack([flight.omega, *measured])).all(axis=1)
    current = -flight.power / flight.battery_voltage if len(flight.power) else np.full(len(flight), np.nan)
    desired = bool(np.isfinite(flight.setpoint[:, :3]).any())
    battery_ticks = max(round(BATTERY_INTERVAL / flight.interval), 1)
    for k in range(len(flight)):
        time_ns = round(k * flight.interval * 1e9)
        header = _header(time_ns)
        volts = tuple(flight.motor_voltage[k].tolist())
        if flight.valid[k]:
            if known[k]:  # quantities of which the flight has no sample are NaN
                pose = Pose(Point(*flight.position[k].tolist()), _quaternion(flight.attitude[k]))
                motion = VehicleState(
                    header=header, pose=pose, velocity=_vector(flight.velocity[k]),
                    angular_velocity=_vector(flight.omega[k]), acceleration=_vector(acceleration[k]),
                    motor_voltage=volts,
                )  # fmt: skip
                yield time_ns, TRUTH, motion
            if "imu" not in flight.readings and np.isfinite(flight.specific_force[k]).all():
                rates, force = _vector(flight.omega[k]), _vector(flight.specific_force[k])
                yield time_ns, IMU, Imu(header=header, angular_velocity=rates, linear_acceleration=force)
            attitude = _vector(flight.attitude_setpoint[k]) if len(flight.attitude_setpoint) else UNSET
            armed = max(volts) > SPINNING * highest
            yield time_ns, ACTUATORS, Actuators(header, volts, armed, attitude_reference=attitude)
            if desired:
                yield time_ns, SETPOINT, _setpoint(header, flight.setpoint[k].tolist())
        if k % battery_ticks == 0 and math.isfinite(flight.battery_voltage[k]):
            battery = UNKNOWN_BATTERY._replace(
                header=header, voltage=float(flight.battery_voltage[k]), current=float(current[k])
            )
            yield time_ns, BATTERY, battery


def _readings(flight: Recording) -> list[Iterator[tuple[int, Topic, Any]]]:
    """Return an iterator over (time [ns], topic, message) for each sensor at its sampling times."""

    def messages(name: str, series: Series) -> Iterator[tuple[int, Topic, Any]]:
        topic, message = SENSORS[name]
        if series.datum == SEA_LEVEL:
            message = _fix_above_sea
        for time, values in zip(series.time, series.values, strict=True):
            if time >= 0.0 and np.isfinite(values).all():
                yield (time_ns := round(float(time) * 1e9)), topic, message(_header(time_ns), values.tolist())

    return [messages(name, series) for name, series in flight.readings.items() if name in SENSORS]


def _setpoint(header: Header, v: Sequence[float]) -> Setpoint:
    return Setpoint(header, Vector3(*v[:3]), Vector3(*v[3:6]), Vector3(*v[6:9]), v[9], v[10])


def _header(time_ns: int) -> Header:
    return Header(Time(time_ns // 1_000_000_000, time_ns % 1_000_000_000), FRAME)


def _vector(values: np.ndarray) -> Vector3:
    return Vector3(*values.tolist())


def _quaternion(wxyz: np.ndarray) -> Quaternion:
    w, x, y, z = wxyz.tolist()
    return Quaternion(x, y, z, w)
