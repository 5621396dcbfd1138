"""Samples of the ports as ArduPilot's state message, in compiled code."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import InputRing
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.services.ardupilot.state_message import Extras, VehicleState
from lapwing.services.common.firmware.exchange import newest
from lapwing.services.common.ports import TrueState

SEA_LEVEL_DENSITY = 1.225  # [kg/m^3] of indicated airspeed


class Samples(NamedTuple):
    """Rings of the vehicle's ports, and flags of its optional sensors."""

    gravity_world: Vec3  # [m/s^2]
    truth: InputRing
    imu: InputRing
    distance: InputRing
    airspeed: InputRing
    battery: InputRing
    has_imu: bool  # rates and specific force of the IMU, otherwise ground truth
    has_distance: bool
    has_airspeed: bool


@always_inline
def specific_force(gravity_world: Vec3, x: TrueState) -> Vec3:
    """Return R^T (a - g) [m/s^2], body, of a true state."""
    a, g = x.acceleration_world, gravity_world
    return quaternion.rotate_back(x.attitude, (a[0] - g[0], a[1] - g[1], a[2] - g[2]))  # type: ignore[no-any-return]


@always_inline
def vehicle_state(p: Samples, tick: int) -> VehicleState:
    """Return the state of the vehicle: ground truth, or rates and specific force of the IMU."""
    x = newest(p.truth, tick)
    omega, force = x.omega_body, specific_force(p.gravity_world, x)
    if p.has_imu:
        imu = newest(p.imu, tick)
        omega, force = imu.omega_body, imu.specific_force_body
    return VehicleState(x.position_world, x.velocity_world, x.attitude, omega, force)


@always_inline
def extras(p: Samples, tick: int) -> Extras:
    """Return the optional fields that the vehicle's sensors fill."""
    distance, airspeed = math.nan, math.nan
    range_reading, pressure_reading = newest(p.distance, tick), newest(p.airspeed, tick)
    if p.has_distance and range_reading.valid:
        distance = range_reading.range
    if p.has_airspeed and pressure_reading.valid:
        airspeed = math.sqrt(2.0 * max(pressure_reading.pressure, 0.0) / SEA_LEVEL_DENSITY)
    battery: Any = newest(p.battery, tick)
    return Extras((distance,), airspeed, battery.voltage, battery.current)
