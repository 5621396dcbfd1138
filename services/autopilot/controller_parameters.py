"""Controller parameters from a gain set and an airframe."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.effects._types import WakeSlopes
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math, python_function
from lapwing.services.autopilot.allocation import (
    effectiveness,
    tables,
    tilted_effectiveness,
    virtual_control_effectiveness,
    wake_effectiveness,
)
from lapwing.services.autopilot.angle_reference import Smoothing
from lapwing.services.autopilot.control import Parameters
from lapwing.services.autopilot.mixer import AIRMODE_ROLL_PITCH, Shares
from lapwing.services.autopilot.motor import Motor, thrust_at
from lapwing.services.autopilot.pid import Pid
from lapwing.services.common.ports import PerRotor

Triple = tuple[float, float, float]  # P, I, D


class Gains(NamedTuple):
    """Numbers of a gain set. Altitude, yaw and inner loops output a force per rotor [N], outer loops a tilt [rad]."""

    altitude: Triple  # over [m]
    yaw: Triple  # over [rad]
    roll_inner: Triple  # over [rad] of tilt to the left, minus the roll: negative
    pitch_inner: Triple  # over [rad]
    roll_outer: Triple  # over [m]
    pitch_outer: Triple  # over [m]
    tilt_limit: float  # [rad]
    reference_bandwidth: float  # [rad/s] natural frequency of the tilt references' filter
    reference_damping: float
    feed_forward: bool  # weight, tilt, setpoint acceleration, and torque of the tilt references


class Airframe(NamedTuple):
    """Vehicle parameters of the controller."""

    mass: float  # [kg]
    inertia_body: Vec3  # principal [kg m^2]
    rotor_x: PerRotor  # positions of the rotors in body axes [m]
    rotor_y: PerRotor
    reaction_sign: PerRotor  # +1 if thrust yaws the vehicle to the left about the rotor's axis
    torque_per_thrust: float  # reaction torque of a rotor over its thrust [m]
    motor: Motor
    voltage_max: float  # [V]
    resting_height: float  # [m] world z of the vehicle's origin at rest on the ground
    gravity: float = STANDARD_GRAVITY  # [m/s^2]
    spin_up_zero: float = 0.0  # [s] torque of rotor acceleration over the change of reaction torque
    rotor_z: PerRotor = ()  # [m] of tilted rotors
    rotor_axis: tuple[Vec3, ...] = ()  # unit vector of each rotor's thrust, body; (): body z
    wakes: WakeSlopes = WakeSlopes()  # coupling of rotors in the wakes of others; thrusts are those of isolated rotors
    rotational_drag: Vec3 = (0.0, 0.0, 0.0)  # [N m s] torque over the rate about each body axis


def build(gains: Gains, airframe: Airframe, geometric: bool = False) -> Parameters:
    """Return the controller's parameters; `geometric` selects the attitude error on SO(3).

    Raises:
        ValueError: the airframe cannot hover in balance.
    """
    thrust_max = python_function(thrust_at)(airframe.motor, airframe.voltage_max)  # avoids compilation at the start
    weight = airframe.mass * airframe.gravity / lift(airframe)  # [N] share of a rotor
    share, needed = shares(airframe), hover_thrust(airframe)
    if thrust_max <= needed:
        raise ValueError(f"maximum thrust of {thrust_max:.1f} N per rotor is below the {needed:.1f} N needed to hover")
    forward = 1.0 if gains.feed_forward else 0.0
    x, y, z = (forward * i / moment for i, moment in zip(airframe.inertia_body, moments(airframe), strict=True))
    return Parameters(
        altitude=Pid(*gains.altitude),
        yaw=Pid(*gains.yaw),
        roll_inner=Pid(*gains.roll_inner),
        pitch_inner=Pid(*gains.pitch_inner),
        roll_outer=Pid(*gains.roll_outer),
        pitch_outer=Pid(*gains.pitch_outer),
        smoothing=Smoothing(gains.reference_bandwidth, gains.reference_damping, forward * airframe.motor.time_constant),
        tilt_limit=gains.tilt_limit,
        hover_collective=forward * weight,
        gravity=airframe.gravity,
        controls_per_acceleration=(x, y, z),
        geometric=geometric,
        shares=share,
        airmode=AIRMODE_ROLL_PITCH,
        thrust_max=thrust_max,
        motor=airframe.motor,
        resting_height=airframe.resting_height,
    )


def hover_thrust(airframe: Airframe) -> float:
    """Return the hover thrust [N] of the most loaded rotor, as an isolated rotor."""
    weight = airframe.mass * airframe.gravity / lift(airframe)
    return weight * max(collective for collective, *_ in shares(airframe)[0])


def hover_torque(airframe: Airframe) -> float:
    """Return the hover torque [N m] of the most loaded rotor."""
    wake_torque = max((math.total(row) for row in airframe.wakes.torque), default=0.0)
    return hover_thrust(airframe) * (airframe.torque_per_thrust + max(wake_torque, 0.0))


def lift(airframe: Airframe) -> float:
    """Return the force along body z [N] of a collective of 1 N: the number of rotors if none is tilted."""
    return _control_effects(*_geometry(airframe))[0]


def moments(airframe: Airframe) -> Vec3:
    """Return the torques about body x, y, z [N m] of virtual controls of 1 N."""
    _, x, y, z = _control_effects(*_geometry(airframe))
    return x, y, z


def shares(airframe: Airframe) -> tuple[Shares, ...]:
    """Return the rotors' shares of the virtual controls. See `allocation.tables`."""
    return _tables(*_geometry(airframe))


def rotor_effectiveness(a: Airframe) -> np.ndarray:
    """Return lift [N] and torques [N m] per 1 N of thrust of every rotor. See `allocation.effectiveness`."""
    return _effectiveness(*_geometry(a))


def _geometry(a: Airframe) -> tuple:
    """Return the arguments of `_effectiveness`."""
    return a.rotor_x, a.rotor_y, a.rotor_z, a.rotor_axis, a.reaction_sign, a.torque_per_thrust, a.wakes


def _effectiveness(
    x: PerRotor, y: PerRotor, z: PerRotor, axes: tuple, signs: PerRotor, torque: float, wakes: WakeSlopes
) -> np.ndarray:
    def isolated(torque: float) -> np.ndarray:
        reaction = tuple(sign * torque for sign in signs)
        if axes:
            return tilted_effectiveness(tuple(zip(x, y, z, strict=True)), axes, reaction)
        return effectiveness(x, y, reaction)

    if not wakes.thrust:
        return isolated(torque)
    return wake_effectiveness(isolated(0.0), isolated(1.0) - isolated(0.0), torque, wakes)


# used several times at a start, and by every run of a campaign
@lru_cache(maxsize=16)
def _control_effects(*geometry: Any) -> tuple[float, ...]:
    return tuple(map(float, virtual_control_effectiveness(_effectiveness(*geometry))))


@lru_cache(maxsize=16)
def _tables(*geometry: Any) -> tuple[Shares, ...]:
    B = _effectiveness(*geometry)
    x, y, z, axes, signs, torque, wakes = geometry
    if not wakes.thrust:
        return tables(B)
    # these weights make all rotors hover at the speed about which the slopes hold
    return tables(B, B[0] / _effectiveness(x, y, z, axes, signs, torque, WakeSlopes())[0])
