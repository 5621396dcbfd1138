"""Samples of the ports as ArduPilot's state message."""

from typing import Any

from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math, python_function
from lapwing.services.ardupilot.resolve import ArduPilotSetup
from lapwing.services.ardupilot.state_message import Extras, VehicleState
from lapwing.services.common import ports
from lapwing.services.common.firmware.link import Read

SEA_LEVEL_DENSITY = 1.225  # [kg/m^3] of indicated airspeed
_rotate_back = python_function(quaternion.rotate_back)


def specific_force(gravity_world: Vec3, x: Any) -> Vec3:
    """Return R^T (a - g) [m/s^2], body, of a true state."""
    a, g = x.acceleration_world, gravity_world
    return _rotate_back(x.attitude, (a[0] - g[0], a[1] - g[1], a[2] - g[2]))  # type: ignore[no-any-return]


def vehicle_state(own: ArduPilotSetup, read: Read) -> VehicleState:
    """Return the state of the vehicle: ground truth, or rates and specific force of the IMU."""
    x = read(ports.TRUTH)
    if own.imu:
        imu = read(ports.IMU)
        omega, force = imu.omega_body, imu.specific_force_body
    else:
        omega, force = x.omega_body, specific_force(own.gravity_world, x)
    return VehicleState(x.position_world, x.velocity_world, x.attitude, omega, force)


def extras(own: ArduPilotSetup, read: Read) -> Extras:
    """Return the optional fields that the vehicle's sensors fill."""
    ranges: tuple[float, ...] = ()
    if own.range_port and (reading := read(own.range_port)).valid:
        ranges = (reading.range,)
    airspeed = None
    if own.airspeed and (pressure := read(ports.AIRSPEED)).valid:
        airspeed = math.sqrt(2.0 * max(pressure.pressure, 0.0) / SEA_LEVEL_DENSITY)
    battery = read(ports.BATTERY)
    return Extras(ranges, airspeed, battery.voltage, battery.current)
