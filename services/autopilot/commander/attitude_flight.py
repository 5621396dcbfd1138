"""Setpoints of attitude and thrust, expressed as feed-forward accelerations."""

from lapwing.dynamics.lie.quaternion import Quaternion, from_roll_pitch_yaw, retract, to_roll_pitch_yaw
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.guidance import Guidance
from lapwing.services.autopilot.land_detector import TAKEOFF_HEIGHT
from lapwing.services.common.ports import Setpoint

_RISING = 0.01  # [m/s]
LEAST_THRUST = 0.08  # fraction of the maximum, at the lower end of the stick (PX4's MPC_MANTHR_MIN)


def stick_thrust(constants: Constants, up: float) -> float:
    """Return the fraction of the maximum thrust for a throttle stick of -1..1, hover at 0 (MPC_THR_CURVE 0)."""
    least, hover = min(LEAST_THRUST, constants.hover_thrust), constants.hover_thrust
    return hover + up * ((1.0 - hover) if up > 0.0 else (hover - least))


class AttitudeFlight:
    """Converts attitudes and body rates into setpoints; the wind integral does not change."""

    def __init__(self, view: CommanderInput):
        """Start from the estimated attitude."""
        self.roll, self.pitch, self.yaw = to_roll_pitch_yaw(view.estimate.attitude)
        self._altitude = view.estimate.position_world[2]

    def turn(self, rates_body: Vec3, guidance: Guidance, dt: float) -> None:
        """Rotate the attitude at body rates [rad/s] for dt [s], up to the maximum tilt."""
        q = retract(from_roll_pitch_yaw(self.roll, self.pitch, self.yaw), tuple(dt * rate for rate in rates_body))
        self.set_attitude(q, guidance)

    def set_attitude(self, attitude: Quaternion, guidance: Guidance) -> None:
        """Set the attitude, limited to the maximum tilt."""
        limit = math.radians(guidance.parameters["MPC_TILTMAX_AIR"])
        roll, pitch, self.yaw = to_roll_pitch_yaw(attitude)
        self.roll, self.pitch = (max(-limit, min(limit, angle)) for angle in (roll, pitch))

    def setpoint(
        self,
        constants: Constants,
        view: CommanderInput,
        guidance: Guidance,
        yaw_rate: float,
        thrust: float,
        climb_rate: float,
    ) -> Setpoint:
        """Return the setpoint of the present attitude and move `guidance` to it.

        Args:
            constants: constants of the vehicle.
            view: input with the estimate of this tick.
            guidance: its smoothed setpoint is replaced.
            yaw_rate: yaw rate of the attitude [rad/s].
            thrust: fraction of the maximum; NaN: the altitude changes at the climb rate.
            climb_rate: [m/s].
        """
        e, g = view.estimate, constants.gravity
        (x, y, z), (vx, vy, vz) = e.position_world, e.velocity_world
        s, c = math.sincos(self.yaw)
        forward, left = g * self.pitch, -g * self.roll
        if thrust > constants.hover_thrust or climb_rate > 0.0:  # makes a vehicle on the ground take off
            z, vz = max(z, constants.resting_height + TAKEOFF_HEIGHT), max(vz, _RISING)
        if math.isnan(thrust):
            self._altitude = max(self._altitude, constants.resting_height) + view.dt * climb_rate
            z, vz, up = self._altitude, climb_rate, 0.0
        else:
            self._altitude = z
            up = g * (thrust / constants.hover_thrust * math.cos(self.roll) * math.cos(self.pitch) - 1.0)
        acceleration = (c * forward - s * left, s * forward + c * left, up)
        setpoint = Setpoint((x, y, z), (vx, vy, vz), acceleration, self.yaw, yaw_rate)
        guidance.follow(setpoint)
        return setpoint
