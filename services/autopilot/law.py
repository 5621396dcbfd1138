"""A gain set put on an airframe: the parameters of the controller."""

import math
from typing import NamedTuple

from dynamics.vector import Vec3
from services.autopilot.control import Parameters
from services.autopilot.interface import Four
from services.autopilot.mixer import Signs
from services.autopilot.motor import Motor, thrust_at
from services.autopilot.pid import Pid
from services.autopilot.reference import Smoothing

Triple = tuple[float, float, float]  # P, I, D


class Gains(NamedTuple):
    """The numbers of a gain set; outputs of altitude, yaw and the inner loops are the force demand of every rotor [N],
    those of the outer loops are tilts [rad]."""

    altitude: Triple  # over [m]
    yaw: Triple  # over [rad]
    roll_inner: Triple  # over [rad] of tilt to the left, which is minus the roll: negative
    pitch_inner: Triple  # over [rad]
    roll_outer: Triple  # over [m]
    pitch_outer: Triple  # over [m]
    tilt_limit: float  # [rad]
    reference_bandwidth: float  # of the tilt references' filter [rad/s]
    reference_damping: float
    feed_forward: bool  # weight, tilt, setpoint acceleration, and the torque that the tilt references need


class Airframe(NamedTuple):
    """What the controller knows of the vehicle."""

    mass: float  # [kg]
    inertia_body: Vec3  # principal [kg m^2]
    rotor_x: Four  # positions of the rotors in body axes [m]
    rotor_y: Four
    reaction_sign: Four  # +1 where thrust turns the vehicle to the left
    torque_per_thrust: float  # reaction torque of a rotor over its thrust [m]
    motor: Motor
    voltage_max: float  # [V]
    resting_height: float  # world z of the vehicle's origin when it stands [m]
    gravity: float = 9.80665  # [m/s^2]
    spin_up_zero: float = 0.0  # [s] torque of speeding the rotors up, over the reaction torque that grows with it


def build(gains: Gains, airframe: Airframe, geometric: bool = False) -> Parameters:
    """The controller's parameters: the gain set on an airframe; `geometric` takes the attitude error on SO(3).

    Raises ValueError where the airframe cannot hover.
    """
    thrust_max = thrust_at(airframe.motor, airframe.voltage_max)
    weight = 0.25 * airframe.mass * airframe.gravity
    if thrust_max <= weight:
        raise ValueError(
            f"the rotors give at most {thrust_max:.1f} N each, less than the {weight:.1f} N that hovering needs"
        )
    forward = 1.0 if gains.feed_forward else 0.0
    x, y, z = (forward * i / (4.0 * arm) for i, arm in zip(airframe.inertia_body, arms(airframe), strict=True))
    return Parameters(
        altitude=Pid(*gains.altitude),
        yaw=Pid(*gains.yaw),
        roll_inner=Pid(*gains.roll_inner),
        pitch_inner=Pid(*gains.pitch_inner),
        roll_outer=Pid(*gains.roll_outer),
        pitch_outer=Pid(*gains.pitch_outer),
        smoothing=Smoothing(gains.reference_bandwidth, gains.reference_damping, forward * airframe.motor.time_constant),
        tilt_limit=gains.tilt_limit,
        hover_demand=forward * weight,
        gravity=airframe.gravity,
        torque_demands=(x, y, z),
        geometric=geometric,
        signs=_signs(airframe),
        thrust_max=thrust_max,
        motor=airframe.motor,
        resting_height=airframe.resting_height,
    )


def arms(airframe: Airframe) -> Vec3:
    """Moments about roll, pitch and yaw axis of a rotor over its thrust [m]: the mean of their sizes."""
    return _mean_size(airframe.rotor_y), _mean_size(airframe.rotor_x), airframe.torque_per_thrust


def _mean_size(values: Four) -> float:
    return sum(abs(v) for v in values) / 4.0


def _signs(airframe: Airframe) -> Signs:
    # Thrust at (x, y) turns the body by (y, -x) times the thrust: theory.md, eq. (4.20).
    a, b, c, d = (
        (math.copysign(1.0, y), -math.copysign(1.0, x), math.copysign(1.0, turn))
        for x, y, turn in zip(airframe.rotor_x, airframe.rotor_y, airframe.reaction_sign, strict=True)
    )
    return a, b, c, d
