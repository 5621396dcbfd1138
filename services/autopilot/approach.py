"""Final approach along a trajectory that ends on the ground: slow near the ground, and on until there is contact."""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, math
from lapwing.services.autopilot.land_detector import GROUNDED, Parameters
from lapwing.services.common.ports import Setpoint

BRAKING = 0.5  # [m/s^2] of a trajectory that is too fast
SPEED_CHANGE = 1.0  # [m/s^2] maximum change of the approach's speed
DEEPEST = 3.0  # [m] of the setpoint below the vehicle: a soft controller (1 rad/s) unloads the feet only so


class Approach(NamedTuple):
    """State of the final approach."""

    active: bool  # the setpoint's height and vertical speed replace those of the trajectory
    z: float  # [m] world
    speed: float  # [m/s] downwards


NO_APPROACH = Approach(False, 0.0, 0.0)


@always_inline
def allowed_speed(p: Parameters, height: float) -> float:
    """Return the maximum speed of descent [m/s] at a height over the ground [m] (theory, eq. (4.29a))."""
    return math.sqrt(p.slow_speed * p.slow_speed + 2.0 * BRAKING * max(0.0, height - p.slow_height))


@always_inline
def move(setpoint: Setpoint, position_world: Vec3, velocity_world: Vec3, acceleration_world: Vec3) -> Setpoint:
    """Return the setpoint with another position [m], velocity [m/s] and acceleration [m/s^2]."""
    s = setpoint
    return Setpoint(
        position_world, velocity_world, acceleration_world,
        s.yaw, s.yaw_rate, s.phase, s.final, s.release, s.landing_speed,
    )  # fmt: skip


@always_inline
def update_approach(p: Parameters, s: Approach, setpoint: Setpoint, z: float, dt: float) -> tuple[Approach, Setpoint]:
    """Return the state and the setpoint after a tick of dt [s]; `z` is the vehicle's estimated world z [m]."""
    x, y, path_z = setpoint.position_world
    vx, vy, climb = setpoint.velocity_world
    lands = setpoint.landing_speed >= 0.0 and climb <= 0.0
    on_ground = path_z - p.resting_height <= GROUNDED
    if not s.active:
        too_fast = setpoint.landing_speed > p.slow_speed and -climb > allowed_speed(p, path_z - p.resting_height)
        if not lands or not (on_ground or too_fast):
            return NO_APPROACH, setpoint
        return Approach(True, path_z, -climb), setpoint  # of this tick, from which the approach goes on
    target = allowed_speed(p, s.z - p.resting_height) if lands else 0.0
    change = SPEED_CHANGE * dt
    speed = min(max(target, s.speed - change), s.speed + change)
    low = max(s.z - speed * dt, z - DEEPEST)
    if path_z >= low and not (lands and on_ground):  # the trajectory is slower, or climbs again
        return NO_APPROACH, setpoint
    ax, ay, _ = setpoint.acceleration_world
    acceleration_world = (ax, ay, (s.speed - speed) / dt)
    return Approach(True, low, speed), move(setpoint, (x, y, low), (vx, vy, -speed), acceleration_world)
