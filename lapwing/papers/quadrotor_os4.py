"""OS4 quadrotor on SO(3): rotor 1 on +x, 2 on +y, 3 on -x, 4 on -y; 1 and 3 turn clockwise seen from above.

Lagrange-d'Alembert gives theory, eqs. (7.11) to (7.14), with the gyroscopic term of the residual rotor speed. Rotors
keep their speed, or follow their motors' voltages if there are motors.
"""

from typing import NamedTuple

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import Quaternion, rotation_matrix
from lapwing.dynamics.vector import Vec3, add, cross, divide, multiply, scale
from lapwing.kernels import always_inline

Four = tuple[float, float, float, float]  # one for each rotor


class Os4Motors(NamedTuple):
    """Direct-current motors without inductance, referred to the rotor's side of the gear."""

    voltage: Four  # [V]
    constant: float  # [N m/A] = [V s/rad]
    resistance: float  # [ohm]


class Os4Parameters(NamedTuple):
    """Parameters of the OS4; SI units, x, y, z along the body axes."""

    mass: float  # [kg]
    inertia: Vec3  # [kg m^2]
    arm: float  # [m]
    lift_constant: float  # [N s^2]
    drag_constant: float  # [N m s^2]
    rotor_inertia: float  # [kg m^2]
    gravity: float  # [m/s^2]
    translational_drag: Vec3  # [N s/m] along the world axes
    motors: Os4Motors | None = None


class Os4State(NamedTuple):
    """State of the OS4; world frame ENU. The tangent has omega_body in place of the attitude."""

    position_world: Vec3  # [m]
    attitude: Quaternion
    velocity_world: Vec3  # [m/s]
    omega_body: Vec3  # [rad/s]
    rotor_speed: Four  # [rad/s], all positive


@always_inline
def _acceleration(p, motors, speed, voltage):
    current = (voltage - motors.constant * speed) / motors.resistance
    return (motors.constant * current - p.drag_constant * speed * speed) / p.rotor_inertia


@always_inline
def rotor_acceleration(p, motors, speed):
    """Return the rotor accelerations [rad/s^2]: torque minus drag, over inertia; 0 without motors (eq. (7.14))."""
    if motors is None:
        return (0.0, 0.0, 0.0, 0.0)
    u = motors.voltage
    return (
        _acceleration(p, motors, speed[0], u[0]),
        _acceleration(p, motors, speed[1], u[1]),
        _acceleration(p, motors, speed[2], u[2]),
        _acceleration(p, motors, speed[3], u[3]),
    )


@always_inline
def rotor_loads(p, speed):
    """Return (thrust [N] along body z, torque [N m] in the body) of the rotors (theory, eq. (7.11))."""
    w1, w2, w3, w4 = speed[0] * speed[0], speed[1] * speed[1], speed[2] * speed[2], speed[3] * speed[3]
    lever = p.arm * p.lift_constant
    return p.lift_constant * (w1 + w2 + w3 + w4), (
        lever * (w2 - w4),
        lever * (w3 - w1),
        p.drag_constant * (w1 - w2 + w3 - w4),
    )


@always_inline
def residual(four):
    """Return the sum over the rotors, signed by their spin direction about body z."""
    return -four[0] + four[1] - four[2] + four[3]


@always_inline
def net_force(p, x):
    """Return the force on the centre of mass without drag [N] in the world: thrust and weight (eq. (7.13))."""
    m = rotation_matrix(x.attitude)
    thrust, _ = rotor_loads(p, x.rotor_speed)
    return add(scale(thrust, (m[2], m[5], m[8])), (0.0, 0.0, -p.mass * p.gravity))


@always_inline
def rate(p, t, x):
    """Return the tangent: Newton and Euler with the rotors' momentum (theory, eqs. (7.12) and (7.13))."""
    o = x.omega_body
    _, torque = rotor_loads(p, x.rotor_speed)
    acceleration = rotor_acceleration(p, p.motors, x.rotor_speed)
    spin = p.rotor_inertia * residual(x.rotor_speed)
    momentum = add(multiply(p.inertia, o), (0.0, 0.0, spin))
    torque = add(torque, add(cross(momentum, o), (0.0, 0.0, -p.rotor_inertia * residual(acceleration))))
    force = add(net_force(p, x), scale(-1.0, multiply(p.translational_drag, x.velocity_world)))
    return Os4State(x.velocity_world, o, scale(1.0 / p.mass, force), divide(torque, p.inertia), acceleration)


RATES[Os4Parameters] = rate
