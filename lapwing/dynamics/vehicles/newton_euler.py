"""Newton's and Euler's equations of one rigid body, selected by the class of its mass properties (theory, 1.1)."""

from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._types import FullMassProperties, OffsetMassProperties
from lapwing.dynamics.vector import ZERO, add, apply, apply_transposed, cross, scale, subtract
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import generic


@generic(inline=True)
def angular_acceleration(body, omega, torque):
    """Return the angular acceleration by Euler's equations (eqs. (1.6), (1.6a)), by mass properties class."""
    return _with_products if body.instance_class is FullMassProperties else _about_principal_axes


@always_inline
def _with_products(body, omega, torque):
    return apply(body.inverse_inertia, subtract(torque, cross(omega, apply(body.inertia, omega))))


@always_inline
def _about_principal_axes(body, omega, torque):
    gyration, inverse = body.gyration, body.inverse_inertia
    return (
        gyration[0] * (omega[1] * omega[2]) + inverse[0] * torque[0],
        gyration[1] * (omega[2] * omega[0]) + inverse[1] * torque[1],
        gyration[2] * (omega[0] * omega[1]) + inverse[2] * torque[2],
    )


@generic(inline=True)
def newton_euler(body, u, s, force, torque):
    """Return (linear [m/s^2], world; angular [rad/s^2], body) acceleration, by mass properties class.

    The force [N] is in the world, the torque [N m] in the body about the motion's position.
    """
    return _about_offset_centre if body.instance_class is OffsetMassProperties else _about_centre


@always_inline
def _about_centre(body, u, s, force, torque):
    return scale(body.inverse_mass, force), angular_acceleration(body, s.motion.omega_body, torque)


@always_inline
def _about_offset_centre(body, u, s, force, torque):
    """Return the accelerations for a centre of mass at c from the position, where gravity acts (eq. (2.42))."""
    R, omega, c = s.R_world_body, s.motion.omega_body, body.centre_body
    weight = scale(body.mass, hooks.all_fields(u.parameters.effects, u.memory, ZERO))
    others = apply_transposed(R, subtract(force, weight))
    angular = _with_products(body, omega, subtract(torque, cross(c, others)))
    turning = add(cross(angular, c), cross(omega, cross(omega, c)))
    return subtract(scale(body.inverse_mass, force), apply(R, turning)), angular
