"""Conversion of Lapwing's samples to Betaflight's state packet and to the pilot's measured motion."""

from lapwing.dynamics.geodesy import enu_to_geodetic, geodetic_to_enu
from lapwing.dynamics.lie.quaternion import NO_ROTATION, conjugate, rotate, to_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import python_function
from lapwing.services.betaflight.packets import State
from lapwing.services.betaflight.pilot import Motion
from lapwing.services.betaflight.resolve import PilotConfig
from lapwing.services.common import ports
from lapwing.services.common.firmware.link import Read

STANDARD_PRESSURE = 101325.0  # [Pa] without a barometer
AIR_WEIGHT = 12.0  # [N/m^3] change of pressure over height near the ground
CURRENT = 0.3  # [s] age of a receiver's velocity that is used as it is; an older one is integrated up to now
HEIGHT_GAIN, SPEED_GAIN = 2.0, 2.0  # [1/s], [1/s^2] of the climb rate's observer
_to_geodetic, _to_enu = python_function(enu_to_geodetic), python_function(geodetic_to_enu)
_rotate, _conjugate = python_function(rotate), python_function(conjugate)
_angles = python_function(to_roll_pitch_yaw)


class StateSource:
    """Newest samples; a sensor without a new reading keeps its last one."""

    def __init__(self, config: PilotConfig, start_world: Vec3):
        """Start with the vehicle at rest at `start_world`, level and heading east."""
        self._config = config
        latitude, longitude, height = _to_geodetic(config.home, start_world)
        force = (0.0, 0.0, config.gravity)
        self.state = State(ZERO, force, NO_ROTATION, ZERO, latitude, longitude, height, STANDARD_PRESSURE)
        self._position, self._velocity, self._fixed_at = start_world, ZERO, 0.0
        self._motion = Motion(start_world, ZERO, 0.0)
        self._integrated = ZERO  # [m/s] velocity of the last fix and the acceleration since then
        self._climb = self._time = 0.0  # [m], [s]
        self._start_pressure: float | None = None

    def update(self, time: float, read: Read) -> Motion:
        """Update the state with the samples at `time` [s]. Return the motion."""
        s, truth = self._config, read(ports.TRUTH)
        state = self.state._replace(attitude=truth.attitude)
        if not s.imu:
            state = state._replace(omega_body=truth.omega_body, specific_force_body=_specific_force(truth, s.gravity))
        elif (imu := read(ports.IMU)).valid:
            state = state._replace(omega_body=imu.omega_body, specific_force_body=imu.specific_force_body)
        if s.barometer and (baro := read(ports.BAROMETER)).valid:
            state = state._replace(pressure=baro.pressure)
        if not s.gps:
            self._position, self._velocity, self._fixed_at = truth.position_world, truth.velocity_world, time
            self._integrated = self._velocity
            latitude, longitude, height = _to_geodetic(s.home, truth.position_world)
            state = state._replace(
                velocity_world=truth.velocity_world, latitude_deg=latitude, longitude_deg=longitude, height=height
            )
        elif (gps := read(ports.GPS)).valid and gps != getattr(self, "_gps", None):
            self._gps = gps
            self._position = tuple(_to_enu(s.home, gps.latitude_deg, gps.longitude_deg, gps.height))
            self._velocity, self._fixed_at = gps.velocity_world, time - gps.age
            self._integrated = self._velocity
            state = state._replace(
                velocity_world=gps.velocity_world,
                latitude_deg=gps.latitude_deg, longitude_deg=gps.longitude_deg, height=gps.height,
            )  # fmt: skip
        self.state = state
        self._integrate(time - self._time)
        age, heading, climb_rate = time - self._fixed_at, _angles(state.attitude)[2], self._integrated[2]
        if age < CURRENT:
            self._motion = Motion(_moved(self._position, self._velocity, age), self._velocity, heading, age, climb_rate)
        else:
            position = _moved(self._motion.position_world, self._integrated, time - self._time)
            self._motion = Motion(position, self._integrated, heading, age, climb_rate)
        self._time = time
        return self._motion

    def _integrate(self, elapsed: float) -> None:
        """Add the acceleration of the last `elapsed` seconds to the velocity; the barometer corrects the climb rate."""
        s = self._config
        ax, ay, az = _rotate(self.state.attitude, self.state.specific_force_body)
        error = 0.0
        if s.barometer:
            if self._start_pressure is None and self.state.pressure != STANDARD_PRESSURE:
                self._start_pressure = self.state.pressure
            error = ((self._start_pressure or self.state.pressure) - self.state.pressure) / AIR_WEIGHT - self._climb
        self._integrated = _moved(self._integrated, (ax, ay, az - s.gravity + SPEED_GAIN * error), elapsed)
        self._climb += elapsed * (self._integrated[2] + HEIGHT_GAIN * error)


def _moved(start: Vec3, rate: Vec3, elapsed: float) -> Vec3:
    x, y, z = (a + b * elapsed for a, b in zip(start, rate, strict=True))
    return x, y, z


def _specific_force(truth: ports.TrueState, gravity: float) -> Vec3:
    ax, ay, az = truth.acceleration_world
    result: Vec3 = _rotate(_conjugate(truth.attitude), (ax, ay, az + gravity))
    return result
