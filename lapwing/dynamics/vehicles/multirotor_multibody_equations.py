"""Equations of motion of a multirotor of five bodies, and the forces in its hinges.

A formulation of the multirotor: each body has its own pose on SE(3), and the arrowhead structure is eliminated
(theory, eqs. (8.40)-(8.46)). The bodies include `gyroscopic_torque`, and mass properties that the reduced model
averages over a turn.
"""

from typing import Any, NamedTuple

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._rotor_sums import total, total_wrench
from lapwing.dynamics.effects._types import Motion, PerRotor
from lapwing.dynamics.lie.quaternion import rotate_back
from lapwing.dynamics.multibody import five_bodies
from lapwing.dynamics.multibody import five_body_stabilisation as hold
from lapwing.dynamics.multibody.delivery_drone import Drone
from lapwing.dynamics.multibody.five_bodies import NO_WRENCH, FiveBodies, Machine, Rotor, Wrench
from lapwing.dynamics.vector import ZERO, Vec3, add, cross, pair, product, scale, subtract
from lapwing.dynamics.vehicles.multirotor_equations import FORMULATIONS, Formulation, evaluate
from lapwing.kernels import always_inline, kernel
from lapwing.kernels.codegen import map_tuple


class Assembly(NamedTuple):
    """Parameters of the bodies, their drives and constraints."""

    drone: Drone
    hold: int  # stabilisation of lapwing.dynamics.multibody.five_body_stabilisation after every step
    feedback: float  # [1/s]
    powered: PerRotor  # 0: the motor gives no torque; with an imposed speed, that speed is zero
    arrays: Any  # system.Arrays of the general engine; () on the fast path


class AppliedLoads(NamedTuple):
    """Loads on the bodies."""

    gravity_world: Vec3  # [m/s^2]
    force_world: Vec3  # [N] on the chassis, weight and thrust not included
    torque_body: Vec3  # [N m] on the chassis
    rotor: tuple  # (thrust [N], torque [N m], acceleration [rad/s^2]) of each rotor, as in the reduced model


@always_inline
def _rotor_speed(chassis_rate, sign, propeller):
    # a rotor whose torque on the body is about +z turns about -z
    return sign * (chassis_rate - propeller.omega_body[2])


@always_inline
def motion_of(layout, x):
    """Return the Motion of the chassis with the rotor speeds; 0 for a detached one."""
    c = x.chassis
    speed = map_tuple(_rotor_speed, c.omega_body[2], layout.reaction_sign, x.propellers)
    speed = map_tuple(product, 0.0, layout.bodies.drone.held, speed)
    return Motion(c.position_world, c.attitude, c.velocity_world, c.omega_body, speed)


@always_inline
def _triple(accelerations, load, k):
    return load[0], load[1], accelerations[k]


@always_inline
def applied_loads(u, t, motion):
    """Return (inputs, AppliedLoads): the effects of `multirotor_equations.evaluate`, separated by body."""
    s, rotors, force, torque = evaluate(u, t, motion)
    R, layout = s.R_world_body, s.layout
    field = hooks.all_fields(u.parameters.effects, u.memory, ZERO)
    applied = add(scale(total(rotors.thrust), (R[2], R[5], R[8])), scale(s.body.mass, field))
    arms = (
        total(map_tuple(product, 0.0, layout.y_body, rotors.thrust)),
        -total(map_tuple(product, 0.0, layout.x_body, rotors.thrust)),
        total(map_tuple(product, 0.0, layout.reaction_sign, rotors.torque)),
    )
    loads = map_tuple(pair, 0.0, rotors.thrust, rotors.torque)
    parts = map_tuple(_triple, rotors.acceleration, loads, (0, 1, 2, 3))
    return s, AppliedLoads(field, subtract(force, applied), subtract(torque, arms), parts)


@always_inline
def _rotor(k, layout, R, motion, part):
    d, sign, powered = layout.bodies.drone, -layout.reaction_sign[k], layout.bodies.powered[k]
    thrust, torque, acceleration = part
    spins, axial = d.spins[k], d.propeller_inertia[k][2]
    drive = powered * sign * (spins * (axial * acceleration + torque) + (1.0 - spins) * acceleration)
    wrench = Wrench(scale(thrust, (R[2], R[5], R[8])), (0.0, 0.0, -sign * torque))
    speed = powered * sign * motion.rotor_speed[k]
    return Rotor(d.propeller_mass[k], d.propeller_inertia[k], d.hubs[k], spins, drive, speed, wrench, d.held[k])


@always_inline
def machine(u, t, motion):
    """Return `five_bodies.Machine` at a time, with the speeds of the state as imposed speeds."""
    s, a = applied_loads(u, t, motion)
    layout, R, part = s.layout, s.R_world_body, a.rotor
    rotors = (
        _rotor(0, layout, R, motion, part[0]),
        _rotor(1, layout, R, motion, part[1]),
        _rotor(2, layout, R, motion, part[2]),
        _rotor(3, layout, R, motion, part[3]),
    )
    mass = s.body.mass - total(layout.bodies.drone.propeller_mass)
    wrench = Wrench(a.force_world, a.torque_body)
    return Machine(mass, s.body.inertia, a.gravity_world, wrench, rotors, layout.bodies.feedback)


@always_inline
def _still(k, layout, motion):
    d = layout.bodies.drone
    speed = -layout.bodies.powered[k] * layout.reaction_sign[k] * motion.rotor_speed[k]
    return Rotor(d.propeller_mass[k], d.propeller_inertia[k], d.hubs[k], d.spins[k], 0.0, speed, NO_WRENCH, d.held[k])


@always_inline
def without_loads(u, motion):
    """Return the machine without loads, for projection."""
    layout = u.parameters.layout
    rotors = (
        _still(0, layout, motion),
        _still(1, layout, motion),
        _still(2, layout, motion),
        _still(3, layout, motion),
    )
    mass = u.body.mass - total(layout.bodies.drone.propeller_mass)
    return Machine(mass, u.body.inertia, ZERO, NO_WRENCH, rotors, 0.0)


@kernel
def rate(u, t, x):
    """Return the tangent of the five bodies."""
    return five_bodies.rate(machine(u, t, motion_of(u.parameters.layout, x)), 0.0, x)


@kernel
def project(u, x):
    """Return the bodies with stabilised constraints."""
    how = u.parameters.layout.bodies.hold
    if how == hold.NONE:
        return x
    p = without_loads(u, motion_of(u.parameters.layout, x))
    return hold.project(p, 0.0, x) if how == hold.PROJECTION else hold.partition(p, 0.0, x)


@kernel
def apply_constraint_impulse(u, x):
    """Return the bodies after hinge impulses that satisfy all constraints and conserve momentum."""
    return hold.project(without_loads(u, motion_of(u.parameters.layout, x)), 0.0, x)


@kernel
def accelerations(u, t, x):
    """Return (linear [m/s^2] in the world, angular [rad/s^2] in the body) of the chassis."""
    tangent = rate(u, t, x)
    return tangent.chassis.velocity_world, tangent.chassis.omega_body


FORMULATIONS[FiveBodies] = Formulation(motion_of, rate, project, accelerations)


@always_inline
def _on_propeller(x, reaction):
    force, torque = reaction
    return force, rotate_back(x.attitude, torque)


@always_inline
def _on_chassis(chassis, x, reaction):
    force, torque = reaction
    arm = subtract(x.position_world, chassis.position_world)
    return scale(-1.0, force), scale(-1.0, rotate_back(chassis.attitude, add(torque, cross(arm, force))))


@kernel
def joints(u, t, x):
    """Return (force [N], world; torque about the centre of mass [N m], body) of the hinges on each body, chassis first.

    The z component of a propeller's torque is that of its drive.
    """
    on = five_bodies.reactions(machine(u, t, motion_of(u.parameters.layout, x)), 0.0, x)
    b, c = x.propellers, x.chassis
    chassis = total_wrench(
        (
            _on_chassis(c, b[0], on[0]),
            _on_chassis(c, b[1], on[1]),
            _on_chassis(c, b[2], on[2]),
            _on_chassis(c, b[3], on[3]),
        )
    )
    return (
        chassis,
        _on_propeller(b[0], on[0]),
        _on_propeller(b[1], on[1]),
        _on_propeller(b[2], on[2]),
        _on_propeller(b[3], on[3]),
    )
