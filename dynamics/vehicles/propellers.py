"""How a vehicle answers to forces: as one rigid body, or with propellers that are bodies of their own.

The choice is a type: `MultirotorParameters.propellers` is None or a `Propellers`, and the compiled plant has the code
of that one only. With propellers the five bodies are solved on the fast path (dynamics/multibody/delivery_drone.py);
their unequal transverse inertia turns at twice the rotor speed (theory.md, section 8.8).
"""

from typing import Any, NamedTuple

from numba import types
from numba.extending import overload

from dynamics.effects._rotors import each, total
from dynamics.effects._types import MassProperties
from dynamics.kernel import leaf
from dynamics.multibody.delivery_drone import Drone, DroneState, Loads, motion
from dynamics.vector import Vec3, add, scale
from dynamics.vehicles.airframe import Airframe


class Propellers(NamedTuple):
    """Four propellers, all alike; each turns about body z with its centre of mass on the hub."""

    mass: float  # [kg] of one
    inertia: Vec3  # [kg m^2] principal moments, x along the blade, z the spin axis
    torque_driven: float  # 1: the motors' torques drive them; 0: the motors' speeds are imposed
    gravity: float  # [m/s^2] on every body, part of the force on the vehicle


def propellers_of(airframe: Airframe, torque_driven: bool, gravity: float) -> Propellers:
    """The propellers of an airframe.

    Raises:
        ValueError: the airframe does not have four, or does not tell their masses and moments.
    """
    r = airframe.rotors
    if len(r.position) != 4:
        raise ValueError(
            f"rotors.position: the multibody model is of 4 propellers, this airframe has {len(r.position)}"
        )
    if r.mass is None or r.transverse_inertia is None:
        raise ValueError("rotors: the multibody model needs mass [kg] and transverse_inertia [kg m^2] of a propeller")
    along, across = r.transverse_inertia
    return Propellers(r.mass, (along, across, r.inertia), float(torque_driven), gravity)


@leaf
def angular_acceleration(body: MassProperties, omega, torque):
    """Euler's equations along principal axes (theory.md, eq. (1.6))."""
    gyration, inverse = body.gyration, body.inverse_inertia
    return (
        gyration[0] * (omega[1] * omega[2]) + inverse[0] * torque[0],
        gyration[1] * (omega[2] * omega[0]) + inverse[1] * torque[1],
        gyration[2] * (omega[0] * omega[1]) + inverse[2] * torque[2],
    )


@leaf
def _rigid(propellers, layout, s, rotors, force, torque):
    return (
        scale(s.body.inverse_mass, force),
        angular_acceleration(s.body, s.motion.omega_body, torque),
        rotors.acceleration,
        s.motion.rotor_angle,
    )


@leaf
def _times(_, a, b):
    return a * b


@leaf
def _against(_, sign, value):
    # a propeller that pushes the body to +z turns about -z itself
    return -sign * value


@leaf
def _motor_torque(inertia, acceleration, torque):
    return inertia * acceleration + torque


@leaf
def answer(b, layout, s, rotors, force, torque):
    """The five bodies' accelerations and hinge loads: `delivery_drone.Motion` under the vehicle's force and torque.

    The hooks' force and torque are those on the vehicle as a whole; here each part goes to the body it acts on.
    """
    m = s.motion
    lift, drag = total(rotors.thrust), each(_times, 0.0, layout.yaw_sign, rotors.torque)
    R = s.R_world_body
    weight = s.body.mass * b.gravity
    chassis_force = add(force, (-lift * R[2], -lift * R[5], weight - lift * R[8]))
    chassis_torque = (
        torque[0] - total(each(_times, 0.0, layout.y_body, rotors.thrust)),
        torque[1] + total(each(_times, 0.0, layout.x_body, rotors.thrust)),
        torque[2] - total(drag),
    )
    motor = each(_motor_torque, b.inertia[2], rotors.acceleration, rotors.torque)
    pushed = motor if b.torque_driven > 0.0 else rotors.acceleration
    loads = Loads(
        chassis_force, chassis_torque, rotors.thrust, drag, each(_against, 0.0, layout.yaw_sign, pushed),
        (0.0, 0.0, -b.gravity),
    )  # fmt: skip
    x, y, z = layout.x_body, layout.y_body, layout.z_body
    k, mass, moments = b.torque_driven, b.mass, b.inertia
    drone = Drone(
        s.body.mass - 4.0 * mass,
        s.body.inertia,
        ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2]), (x[3], y[3], z[3])),
        (mass, mass, mass, mass),
        (moments, moments, moments, moments),
        (k, k, k, k),
    )
    turning = each(_against, 0.0, layout.yaw_sign, m.rotor_speed)
    state = DroneState(m.position_world, m.attitude, m.velocity_world, m.omega_body, m.rotor_angle, turning)
    return motion(drone, loads, state), turning


@leaf
def _jointed(propellers, layout, s, rotors, force, torque):
    found, turning = answer(propellers, layout, s, rotors, force, torque)
    spin = each(_against, 0.0, layout.yaw_sign, found.spin_acceleration)
    return found.acceleration_world, found.angular_acceleration_body, spin, turning


def response(propellers: Any, layout: Any, s: Any, rotors: Any, force: Vec3, torque: Vec3) -> tuple:
    """How the vehicle moves under force [N], world frame, and torque [N m], body frame, at its centre of mass.

    Returns:
        (acceleration_world [m/s^2], angular_acceleration_body [rad/s^2], acceleration of each rotor [rad/s^2], rate of
        each rotor's angle [rad/s]).
    """
    raise NotImplementedError("compiled code only")


@overload(response, jit_options={"forceinline": True})
def _response(propellers, layout, s, rotors, force, torque):
    chosen = _rigid if isinstance(propellers, types.NoneType) else _jointed
    return lambda propellers, layout, s, rotors, force, torque: chosen(propellers, layout, s, rotors, force, torque)
