"""Samples of the ports between services: NamedTuples of numbers in SI units, world ENU, body FLU.

The services' `encoders.py` turn them into messages. Tuples per rotor or per body have the vehicle's length.
"""

import math
from typing import NamedTuple

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vector import ZERO, Vec3

TRUTH, BATTERY, BODIES, CONTACT = "truth", "battery", "bodies", "contact"
IMU, MAGNETOMETER, GPS, BAROMETER, SONAR = "imu", "magnetometer", "gps", "barometer", "sonar"
IMUS = (IMU, "imu2", "imu3")  # redundant units
REDUNDANT = {IMU: IMUS[1:], GPS: ("gps2",), MAGNETOMETER: ("magnetometer2",)}  # further units of an instrument
IMU_SELECTION = "imu_selection"
OPTICAL_FLOW, RANGEFINDER, AIRSPEED = "optical_flow", "rangefinder", "airspeed"
EXTERNAL_VISION = "external_vision"
TRAJECTORY, ACTUATORS, SETPOINT, STATUS, ESTIMATE = "trajectory", "actuators", "setpoint", "status", "estimate"
ESTIMATE_COVARIANCE = "estimate_covariance"
LIFT = "lift"
EFFECT = "effect."  # prefix of the ports with the named inputs of an effect: "effect.battery"

GPS_SINGLE, GPS_SBAS, GPS_FLOAT, GPS_RTK = 1, 2, 3, 4  # `GpsReading.fix`: alone, augmented, RTK float and fixed

PerRotor = tuple[float, ...]


class TrueState(NamedTuple):
    """True state of a vehicle at a tick."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # body to world
    velocity_world: Vec3 = ZERO  # [m/s]
    omega_body: Vec3 = ZERO  # [rad/s]
    acceleration_world: Vec3 = ZERO  # [m/s^2] dv/dt
    rotor_speed: PerRotor = ()  # [rad/s]
    motor_voltage: PerRotor = ()  # [V]
    motor_current: PerRotor = ()  # [A]
    motor_power: PerRotor = ()  # [W] electrical
    rotor_thrust: PerRotor = ()  # [N]
    rotor_torque: PerRotor = ()  # [N m] about the shaft
    wind_world: Vec3 = ZERO  # [m/s] velocity of the air
    air_density: float = 0.0  # [kg/m^3]
    ground_contact: bool = False  # any foot touches the ground
    angular_acceleration_body: Vec3 = ZERO  # [rad/s^2] of a multirotor


class BatteryReading(NamedTuple):
    """State of the battery."""

    charge: float = 0.0  # fraction; NaN if no effect models it
    voltage: float = 0.0  # [V]
    current: float = 0.0  # [A] drawn
    temperature: float = math.nan  # [K]; NaN if no effect models it


class BodyMotions(NamedTuple):
    """True state of each body of a multibody vehicle; every tuple has an entry per body."""

    position_world: tuple[Vec3, ...]  # [m]
    attitude: tuple[Quaternion, ...]
    velocity_world: tuple[Vec3, ...]  # [m/s]
    omega_body: tuple[Vec3, ...]  # [rad/s]
    force_world: tuple[Vec3, ...]  # [N] of contacts or joints
    torque_body: tuple[Vec3, ...]  # [N m] of contacts or joints


class ContactForces(NamedTuple):
    """Ground forces on the contact points of a vehicle; every tuple has an entry per point."""

    position_world: tuple[Vec3, ...]  # [m]
    force_world: tuple[Vec3, ...]  # [N]


class ImuReading(NamedTuple):
    """One reading of an inertial measurement unit."""

    omega_body: Vec3 = ZERO  # [rad/s]
    specific_force_body: Vec3 = ZERO  # [m/s^2], R^T (a - g): +g along z at rest
    omega_variance: float = 0.0  # [(rad/s)^2] per axis, of the white noise
    specific_force_variance: float = 0.0  # [(m/s^2)^2]
    valid: bool = False


class ImuSelection(NamedTuple):
    """Result of the vote between redundant inertial measurement units."""

    unit: int = 1  # in use, from 1
    failed: int = 0  # bit i: unit i + 1 has failed
    switched: bool = False  # another unit than at the reading before


class MagnetometerReading(NamedTuple):
    """One reading of a magnetometer."""

    field_body: Vec3 = ZERO  # [T]
    variance: float = 0.0  # [T^2] per axis, of the white noise
    valid: bool = False


class GpsReading(NamedTuple):
    """One reading of a satellite receiver: the antenna's state `age` seconds ago."""

    latitude_deg: float = 0.0  # [deg] north
    longitude_deg: float = 0.0  # [deg] east
    height: float = 0.0  # [m] over the ellipsoid
    position_variance: Vec3 = ZERO  # [m^2] east, north, up: white and correlated error together
    velocity_world: Vec3 = ZERO  # [m/s]
    velocity_variance: float = 0.0  # [(m/s)^2] per axis
    age: float = 0.0  # [s]
    valid: bool = False
    fix: int = 0  # GPS_SINGLE, GPS_SBAS, GPS_FLOAT or GPS_RTK; 0: not modelled
    used: int = 0  # satellites of the fix; 0: not modelled
    visible: int = 0  # satellites above the mask
    hdop: float = 0.0  # horizontal dilution of precision; 0: unknown
    vdop: float = 0.0  # vertical dilution of precision; 0: unknown


class BarometerReading(NamedTuple):
    """One reading of a barometer."""

    pressure: float = 0.0  # [Pa]
    variance: float = 0.0  # [Pa^2], of the white noise
    valid: bool = False


class DistanceReading(NamedTuple):
    """One reading of a sonar or a rangefinder, with the conventions of sensor_msgs/Range."""

    range: float = 0.0  # [m]; +inf: nothing in range, -inf: below range_min; rounded to float32 for a sonar
    variance: float = 0.0  # [m^2], of the white noise; rounded to float32 for a sonar
    valid: bool = False


class OpticalFlowReading(NamedTuple):
    """One reading of a downward-facing optical flow camera."""

    flow: tuple[float, float] = (0.0, 0.0)  # [rad/s] about body x and y
    rate: tuple[float, float] = (0.0, 0.0)  # [rad/s] of the body about the same axes
    distance: float = 0.0  # [m] along the camera's axis
    variance: float = 0.0  # [(rad/s)^2] of the flow's white noise, per axis
    valid: bool = False


class ExternalVisionReading(NamedTuple):
    """One pose of the body in the world, from cameras on board or in the room."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # body to world
    position_variance: float = 0.0  # [m^2] per axis, of the white noise
    attitude_variance: float = 0.0  # [rad^2]
    valid: bool = False


class AirspeedReading(NamedTuple):
    """One reading of a differential pressure sensor."""

    pressure: float = 0.0  # [Pa]
    variance: float = 0.0  # [Pa^2], of the white noise
    valid: bool = False


class Setpoint(NamedTuple):
    """Setpoint of the vehicle's motion."""

    position_world: Vec3 = ZERO  # [m]
    velocity_world: Vec3 = ZERO  # [m/s]
    acceleration_world: Vec3 = ZERO  # [m/s^2]
    yaw: float = 0.0  # [rad]
    yaw_rate: float = 0.0  # [rad/s]
    phase: int = 0  # index of the phase's name
    final: bool = False  # no later phase ends in the air: the next landing is the last
    release: bool = False  # open the gripper once the vehicle rests on the ground
    landing_speed: float = -1.0  # [m/s] downwards at which the phase reaches the ground; negative: it ends in the air


class MotorCommand(NamedTuple):
    """Motor command of the autopilot."""

    motor_voltage: PerRotor  # [V]
    armed: bool
    thrust: PerRotor  # [N] commanded
    attitude_reference: Vec3  # [rad] roll, pitch, yaw references of the inner loops


class AutopilotStatus(NamedTuple):
    """Numeric part of the autopilot's status."""

    phase: int = 0  # index of the phase's name
    status_text_id: int = 0  # index of the commander's status texts
    armed: bool = False
    landed: bool = True
    finished: bool = False
    battery_warning: int = 0  # 0 none or unknown, 1 low, 2 critical, 3 nearly empty
    failed_motor: int = 0  # from 1; 0: none
    released: bool = False  # the gripper is open


class StateEstimate(NamedTuple):
    """State estimate with the standard deviations of its error."""

    position_world: Vec3 = ZERO  # [m]
    attitude: Quaternion = NO_ROTATION  # (w, x, y, z), body to world
    velocity_world: Vec3 = ZERO  # [m/s]
    omega_body: Vec3 = ZERO  # [rad/s], bias removed
    acceleration_world: Vec3 = ZERO  # [m/s^2], dv/dt
    gyro_bias: Vec3 = ZERO  # [rad/s]
    accelerometer_bias: Vec3 = ZERO  # [m/s^2]
    position_std: Vec3 = ZERO  # [m] world
    velocity_std: Vec3 = ZERO  # [m/s] world
    attitude_std: Vec3 = ZERO  # [rad] rotation vector, body
    health: int = 0  # 0: good
    rejected: int = 0  # bit i: the last reading of source i was rejected


class EstimateCovariance(NamedTuple):
    """Covariance of the estimator's 24 error states, in the order of EstimateCovariance.msg."""

    covariance: tuple[float, ...] = (0.0,) * 300  # upper triangle, row by row
    nis: tuple[float, ...] = (0.0,) * 7  # normalised innovations squared, by source


class RotorWrenches(NamedTuple):
    """Rotor wrench of each quadrotor of a formation."""

    thrust: tuple[float, ...]  # [N] along body z
    moment_body: tuple[Vec3, ...]  # [N m]
