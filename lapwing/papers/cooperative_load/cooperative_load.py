"""N quadrotors carrying a point mass by rigid massless links, on R^6 x (TSO(3))^N x (TS^2)^N, N >= 2.

The model of Lee, Sreenath and Kumar (CDC 2013) in ENU: a link's direction points from its quadrotor to the load. The
equations are theory, eqs. (7.17) to (7.21); the constraints are part of the state space and cannot drift.
"""

from typing import Any, NamedTuple

from lapwing.dynamics.integrators import RATES
from lapwing.dynamics.lie.quaternion import Quaternion, rotation_matrix
from lapwing.dynamics.lie.ts2 import Swing, tangent
from lapwing.dynamics.vector import Mat3, Vec3, add, apply, cross, divide, dot, multiply, scale, subtract
from lapwing.kernels import DispatchTable, always_inline, kernel
from lapwing.kernels.codegen import map_index, overload_for


class LiftCommand(NamedTuple):
    """Thrust and moment of each quadrotor; the plant holds them between updates."""

    thrust: tuple[float, ...]  # [N] along body z
    moment_body: tuple[Vec3, ...]  # [N m]


class CooperativeLoadParameters(NamedTuple):
    """Parameters of the formation; tuples have one entry for each quadrotor."""

    quad_mass: tuple[float, ...]  # [kg]
    quad_inertia: tuple[Vec3, ...]  # [kg m^2] principal moments
    link_length: tuple[float, ...]  # [m]
    load_mass: float  # [kg]
    gravity: float  # [m/s^2]
    control: Any  # a LiftCommand, or the parameters of a control law registered in COMMANDS

    def check(self, x0: Any) -> None:
        """Raise ValueError for fewer than two quadrotors, unequal lengths of tuples, or a non-positive mass or link."""
        n = len(x0.link)
        counts = {len(t) for t in (self.quad_mass, self.quad_inertia, self.link_length, x0.attitude, x0.omega_body)}
        if n < 2 or counts != {n}:
            raise ValueError(
                f"CooperativeLoad: {n} links for tuples of {sorted(counts)} entries: two or more, all alike"
            )
        for name in ("quad_mass", "link_length"):
            for i, value in enumerate(getattr(self, name)):
                if not value > 0.0:
                    raise ValueError(f"CooperativeLoad: {name}[{i}] = {value:g}: must be positive")
        if not self.load_mass > 0.0:
            raise ValueError(f"CooperativeLoad: load_mass = {self.load_mass:g}: must be positive")


class CooperativeLoadState(NamedTuple):
    """State of load, quadrotors and links; world frame ENU."""

    load_position: Vec3  # [m]
    load_velocity: Vec3  # [m/s]
    attitude: tuple[Quaternion, ...]
    omega_body: tuple[Vec3, ...]  # [rad/s]
    link: tuple[Swing, ...]  # direction from quadrotor to load, angular velocity [rad/s]


COMMANDS = DispatchTable()
"""The compiled `command(p, t, x) -> LiftCommand` of a control law, by the class of its parameters (`p.control`)."""


def command(p: CooperativeLoadParameters, t: float, x: CooperativeLoadState) -> LiftCommand:
    """Return the LiftCommand at time t: `p.control` itself, or the output of its control law."""
    return p.control if isinstance(p.control, LiftCommand) else COMMANDS[type(p.control)](p, t, x)


@overload_for(command)
def _command(p, t, x):
    control = p.types[p.fields.index("control")].instance_class
    if control is LiftCommand:
        return lambda p, t, x: p.control
    law = COMMANDS[control]
    return lambda p, t, x: law(p, t, x)


@always_inline
def solve_symmetric(m: Mat3, b: Vec3) -> Vec3:
    """Return the solution of m x = b for a symmetric 3x3 matrix, by cofactors."""
    c0 = m[4] * m[8] - m[5] * m[5]
    c1 = m[5] * m[2] - m[1] * m[8]
    c2 = m[1] * m[5] - m[4] * m[2]
    c4 = m[0] * m[8] - m[2] * m[2]
    c5 = m[1] * m[2] - m[0] * m[5]
    c8 = m[0] * m[4] - m[1] * m[1]
    k = 1.0 / (m[0] * c0 + m[1] * c1 + m[2] * c2)
    return scale(k, apply((c0, c1, c2, c1, c4, c5, c2, c5, c8), b))


@always_inline
def add_outer(m: Mat3, weight: float, q: Vec3) -> Mat3:
    """Return m + weight q q^T."""
    x, y, z = weight * q[0], weight * q[1], weight * q[2]
    return (
        m[0] + x * q[0], m[1] + x * q[1], m[2] + x * q[2],
        m[3] + y * q[0], m[4] + y * q[1], m[5] + y * q[2],
        m[6] + z * q[0], m[7] + z * q[1], m[8] + z * q[2],
    )  # fmt: skip


@always_inline
def thrust_world(x, thrust, i):
    """Return the thrust of quadrotor i in the world [N]."""
    m = rotation_matrix(x.attitude[i])
    return scale(thrust[i], (m[2], m[5], m[8]))


@kernel
def load_acceleration(p, x, force):
    """Return v' - a_g of the load: M_q (v' - a_g) = sum of (q . u - m L |omega|^2) q (theory, eq. (7.19))."""
    matrix = (p.load_mass, 0.0, 0.0, 0.0, p.load_mass, 0.0, 0.0, 0.0, p.load_mass)
    pull = (0.0, 0.0, 0.0)
    for i in range(len(force)):
        q, omega = x.link[i].direction, x.link[i].omega
        matrix = add_outer(matrix, p.quad_mass[i], q)
        along = dot(q, force[i]) - p.quad_mass[i] * p.link_length[i] * dot(omega, omega)
        pull = add(pull, scale(along, q))
    return solve_symmetric(matrix, pull)


@always_inline
def link_acceleration(p, x, force, specific, i):
    """Return omega' of link i [rad/s^2]: L omega' = q x (v' - a_g - u / m) (theory, eq. (7.20))."""
    relative = subtract(specific, scale(1.0 / p.quad_mass[i], force[i]))
    return scale(1.0 / p.link_length[i], cross(x.link[i].direction, relative))


@always_inline
def _link_rate(p, x, force, specific, i):
    return tangent(x.link[i], link_acceleration(p, x, force, specific, i))


@always_inline
def body_rate(p, x, lift, i):
    """Return the angular acceleration [rad/s^2] of quadrotor i under a LiftCommand (theory, eq. (7.18))."""
    inertia, o = p.quad_inertia[i], x.omega_body[i]
    return divide(add(lift.moment_body[i], cross(multiply(inertia, o), o)), inertia)


@kernel
def rate(p, t, x):
    """Return the tangent of the whole system (theory, eqs. (7.18) to (7.21))."""
    lift = command(p, t, x)
    force = map_index(thrust_world, x.link, x, lift.thrust)
    specific = load_acceleration(p, x, force)
    return CooperativeLoadState(
        x.load_velocity,
        add(specific, (0.0, 0.0, -p.gravity)),
        x.omega_body,
        map_index(body_rate, x.link, p, x, lift),
        map_index(_link_rate, x.link, p, x, force, specific),
    )


RATES[CooperativeLoadParameters] = rate


@always_inline
def quad_position(p, x, i):
    """Return the position [m] of quadrotor i: the load's minus the link."""
    return subtract(x.load_position, scale(p.link_length[i], x.link[i].direction))


@always_inline
def quad_velocity(p, x, i):
    """Return the velocity [m/s] of quadrotor i."""
    return subtract(x.load_velocity, scale(p.link_length[i], cross(x.link[i].omega, x.link[i].direction)))
