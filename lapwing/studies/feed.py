"""Log in the loop: the sensors of a recorded flight drive a firmware, whose estimate is compared with the recorded one.

The firmware's adapter runs as in a flight, in lock step; a block with the readings replaces plant and sensors. The
firmware stays disarmed: its filter works as on the ground where it distinguishes this.
"""

import hashlib
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.dynamics.geodesy import Home
from lapwing.flights import rotation_arrays as rotations
from lapwing.flights.log_import.recording import Recording, Series
from lapwing.services.ardupilot.link import ArduPilotLink
from lapwing.services.common import ports
from lapwing.services.common.firmware.mission_client import MissionClient
from lapwing.services.common.firmware.service import firmware_service
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.geo_coordinates import enu_to_geodetic
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.px4.link import Px4Link
from lapwing.services.scene_resolver import load, resolve

EVERY = 20_000.0  # [us] between two estimates
AHEAD = 0.02  # [s] of the begin after a fix, so that none is late by a period if they jitter
VARIANCE = (0.25, 0.25, 0.64)  # [m^2] of a fix, which is not imported
KEPT_TICKS = 64  # [ticks] history of the ports
SENSORS: dict[str, tuple[str, Any]] = {  # name in the recording, and class of the reading
    ports.GPS: ("gps", ports.GpsReading),
    ports.MAGNETOMETER: ("mag", ports.MagnetometerReading),
    ports.BAROMETER: ("baro", ports.BarometerReading),
}
SCENES = {  # changes of the scene `FIRMWARE_quad`: without its mission
    "px4": ("px4={}",),
    "ardupilot": ('ardupilot={inertial="sensors"}', "sensors.imu.preset=mpu6000"),
}


class Estimates(MissionClient):
    """Client that keeps the firmware's estimates: time [s] of its clock, quaternion, or position and velocity, NED."""

    def __init__(self, *arguments: Any, **options: Any):
        """Create the client; see `MissionClient`."""
        super().__init__(*arguments, **options)
        self.attitudes: list[tuple[float, ...]] = []
        self.motions: list[tuple[float, ...]] = []

    def _on_heartbeat(self, message: Any) -> None:
        known = self.connected
        super()._on_heartbeat(message)
        if self.connected and not known:
            for number in (mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED):
                self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, EVERY)

    def _on_attitude_quaternion(self, m: Any) -> None:
        self.attitudes.append((1e-3 * m.time_boot_ms, m.q1, m.q2, m.q3, m.q4))

    def _on_local_position_ned(self, m: Any) -> None:
        self.motions.append((1e-3 * m.time_boot_ms, m.x, m.y, m.z, m.vx, m.vy, m.vz))


class Estimate(NamedTuple):
    """Estimates over the time [s] of a recording, world ENU and body FLU."""

    name: str
    attitude: Series  # unit quaternions with continuous signs
    position: Series  # [m]
    velocity: Series  # [m/s]
    digest: str = ""  # of all numbers from the firmware
    report: str = ""  # counts of the lock step


class Feed:
    """Block that writes the readings of a recording to the ports of plant and sensors."""

    def __init__(self, flight: Recording, outputs: Sequence[Port], interval: float, begin: float):
        """Create the block; tick 0, of an `interval` [s], is the time `begin` [s] of the recording."""
        self.name, self.outputs, self._flight = "feed", tuple(outputs), flight
        self._interval, self._begin = interval, begin
        own, time = recorded(flight), flight.interval * np.arange(len(flight))
        raw = Series(time, np.nan_to_num(np.hstack([flight.omega, flight.specific_force])))
        acceleration = np.gradient(own.velocity.values, own.velocity.time, axis=0)
        self._volts = Series(time, np.nan_to_num(flight.battery_voltage[:, None]))
        self._imu, self._velocity = flight.readings.get("imu", raw), flight.readings.get("gps_velocity", own.velocity)
        self._truth = own.position, own.attitude, own.velocity, Series(own.velocity.time, acceleration)

    def bind(self, diagram: BlockDiagram) -> None:
        """Store the diagram."""
        self._diagram = diagram

    def on_tick(self, tick: int) -> int:
        """Write the readings that are due at a tick."""
        for port in self.outputs:
            period = max(port.period, 1)
            if tick % period == 0:
                time = self._begin + tick * self._interval
                self._diagram.put(port.name, tick, self.sample(port, time, period * self._interval))
        return tick + 1

    def sample(self, port: Port, time: float, period: float) -> Any:
        """Return the sample of a port at a `time` [s]: one of a sensor if it is newer than a `period` [s]."""
        if port.name in SENSORS:
            return self.newest(port.name, time, period)
        imu = _at(self._flight.readings[port.name] if port.name in ports.IMUS[1:] else self._imu, time)
        if port.name in ports.IMUS:
            return ports.ImuReading(imu[:3], imu[3:], valid=True)
        if port.name == ports.BATTERY:
            return port.example._replace(charge=1.0, voltage=_at(self._volts, time)[0])
        position, attitude, velocity, acceleration = (_at(series, time) for series in self._truth)
        return port.example._replace(
            position_world=position, attitude=attitude, velocity_world=velocity, omega_body=imu[:3],
            acceleration_world=acceleration,
        )  # fmt: skip

    def newest(self, port: str, time: float, period: float) -> Any:
        """Return the newest reading of a sensor, an invalid one if it is older than a `period` [s]."""
        name, kind = SENSORS[port]
        series = self._flight.readings.get(name)
        row = -1 if series is None else int(np.searchsorted(series.time, time, side="right")) - 1
        if series is None or row < 0 or time - series.time[row] >= period:
            return kind()
        values = series.values[row].tolist()
        if port == ports.GPS:
            return kind(*values, VARIANCE, _at(self._velocity, time), valid=True)
        return kind(values[0] if port == ports.BAROMETER else tuple(values), valid=True)


def feed(flight: Recording, firmware: str, command: Sequence[str], overrides: Sequence[str]) -> Estimate:
    """Return the estimate of a firmware that gets the sensors of a flight.

    Args:
        flight: recording.
        firmware: "px4" or "ardupilot".
        command: program and arguments; empty: wait for one that is started elsewhere.
        overrides: further "key=value" of the scene `FIRMWARE_quad`.

    Raises:
        ValueError: the recording lacks what the firmware needs.
        LockStepError: the firmware does not start, or does not answer.
    """
    if firmware not in SCENES:
        raise ValueError(f"--firmware {firmware}: expected {' or '.join(SCENES)}")
    if flight.missing:
        raise ValueError(f"{flight.name}: no {', '.join(flight.missing)} to compare with; expected a flight with GPS")
    own, fixes = recorded(flight), flight.readings.get("gps")
    scene = load(f"{firmware}_quad", [*SCENES[firmware], f"autopilot.command={json.dumps(list(command))}", *overrides])
    imus = 1 + sum(name in flight.readings for name in ports.IMUS[1:])
    if firmware == "px4" and imus > 1:
        scene = load(scene, [f"sensors.imu.instances={imus}"])
    begin = 0.0
    if fixes is not None and len(fixes.time) > 1:  # the log's origin is home
        begin = float(fixes.time[0]) + AHEAD
        origin = Home(*enu_to_geodetic(Home(*fixes.values[0].tolist()), [-x for x in _at(own.position, begin)]))
        values = {f"environment.home.{name}": value for name, value in origin._asdict().items()}
        if firmware == "px4":
            values["sensors.gps.rate"] = _rate(scene[Communication].rate, 1.0 / float(np.median(np.diff(fixes.time))))
        scene = load(scene, [f"{key}={value!r}" for key, value in values.items()])
    config = resolve(scene)
    settings = config.services[firmware]
    outputs = [config.port(given.port) for given in settings.inputs]
    block = Feed(flight, outputs, config.interval, begin)
    parameters = settings.parameters
    if firmware == "px4":  # readings before the first tick
        field, air = block.newest(ports.MAGNETOMETER, begin, np.inf), block.newest(ports.BAROMETER, begin, np.inf)
        first = {"force_body": block.sample(config.port(ports.IMU), begin, 0.0).specific_force_body}
        first |= {"field_body": field.field_body} if field.valid else {}
        first |= {"pressure": air.pressure} if air.valid else {}
        parameters = parameters._replace(own=parameters.own._replace(**first))
    last_tick = int((own.attitude.time[-1] - begin) / config.interval)
    config = config._replace(last_tick=last_tick, services={firmware: settings._replace(parameters=parameters)})
    link = (Px4Link if firmware == "px4" else ArduPilotLink)(config.services[firmware].parameters, Estimates)
    services = [Service("feed", [block], []), firmware_service(config, name=firmware, link=lambda _: link)]
    diagram = BlockDiagram(config, services, KEPT_TICKS)
    try:
        diagram.advance(last_tick + 1)
        report = diagram.reports["firmware"]
    finally:
        diagram.close()
    return _estimate(link, begin, report)


def recorded(flight: Recording) -> Estimate:
    """Return the estimate of a recording at its valid samples."""
    time = (flight.interval * np.arange(len(flight)))[flight.valid]
    attitude = rotations.continuous(rotations.unit(flight.attitude[flight.valid]))
    position, velocity = flight.position[flight.valid], flight.velocity[flight.valid]
    return Estimate("log", Series(time, attitude), Series(time, position), Series(time, velocity))


def difference(first: Estimate, second: Estimate, begin: float) -> list[tuple[str, float, float]]:
    """Return unit, root mean square and maximum of the differences after `begin` [s]: deg, m/s, and m without the mean.

    The origins of two estimates differ, therefore the mean difference of the positions is subtracted.

    Raises:
        ValueError: the estimates have no common time.
    """
    result = []
    pairs = (first.attitude, second.attitude), (first.velocity, second.velocity), (first.position, second.position)
    for unit, (a, b) in zip(("deg", "m/s", "m"), pairs, strict=True):
        time = a.time[(a.time >= max(begin, b.time[0])) & (a.time <= b.time[-1])]
        if not len(time):
            raise ValueError(f"no common time of {first.name} and {second.name} after {begin:g} s; use a longer flight")
        if unit == "deg":
            turn = rotations.product(rotations.conjugate(rotations.unit(a.at(time))), rotations.unit(b.at(time)))
            error = np.degrees(rotations.rotation_vector(turn))
        else:
            error = b.at(time) - a.at(time)
        error = np.linalg.norm(error - (error.mean(axis=0) if unit == "m" else 0.0), axis=1)
        result.append((unit, float(np.sqrt(np.mean(error**2))), float(error.max())))
    return result


def _estimate(link: Any, begin: float, report: str) -> Estimate:
    attitudes, motions = np.array(link.client.attitudes), np.array(link.client.motions)
    name, digest = report.partition(":")[0], hashlib.blake2b(digest_size=8)
    if not len(attitudes) or not len(motions):
        raise ValueError(f"{name}: sends no ATTITUDE_QUATERNION and LOCAL_POSITION_NED; use a longer flight")
    for part in (attitudes, motions):
        digest.update(part.tobytes())
        part[:, 0] += begin - link.clock_at_start
    turns = rotations.continuous(rotations.from_ned_frd(attitudes[:, 1:]))
    position, velocity = (rotations.ned_to_enu(motions[:, columns]) for columns in (slice(1, 4), slice(4, 7)))
    time = motions[:, 0]
    attitude = Series.of(attitudes[:, 0], turns)
    return Estimate(name, attitude, Series.of(time, position), Series.of(time, velocity), digest.hexdigest(), report)


def _at(series: Series, time: float) -> Any:
    return tuple(series.at(np.array([time]))[0].tolist())


def _rate(ticks: float, measured: float) -> int:
    """Return the rate [Hz] nearest to a measured one that divides the rate of the ticks."""
    return min((n for n in range(1, int(ticks) + 1) if ticks % n == 0), key=lambda n: abs(n - measured))
