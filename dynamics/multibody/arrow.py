"""The fast path: one core body and four leaves hinged to it at their centres of mass, nothing assembled.

Every leaf is eliminated into the core's equations (theory.md, eqs. (8.40)-(8.45)); what remains is one symmetric 3x3
system. All vectors are in the same axes, whichever they are. A symmetric matrix is six floats (xx, yy, zz, xy, xz, yz).
"""

from typing import NamedTuple

from dynamics.kernel import leaf
from dynamics.vector import Vec3, add, cross, dot, scale, subtract

Sym3 = tuple[float, float, float, float, float, float]


class Core(NamedTuple):
    """The core body and what acts on it."""

    mass: float  # [kg]
    inertia: Sym3  # [kg m^2]
    force: Vec3  # [N]
    torque: Vec3  # [N m], gyroscopic part included


class Leaf(NamedTuple):
    """A leaf, the motion its hinge leaves it, a_leaf = a + alpha x offset + drift, alpha_leaf = alpha + turn + s axis,
    and what acts on it. A leaf that is gone has no mass and no inertia."""

    mass: float  # [kg]
    inertia: Sym3  # about its centre of mass [kg m^2]; without the axial moment if it spins freely, eq. (8.42)
    offset: Vec3  # hinge point from the core's centre of mass [m]
    axis: Vec3  # unit vector, a principal axis of the inertia
    axial: float  # moment of inertia about the axis [kg m^2]
    spins: float  # 1: s follows from `drive_torque`; 0: s = 0, the whole turn is imposed
    drive_torque: float  # about the axis, from the core on the leaf [N m]
    drift: Vec3  # [m/s^2]
    turn: Vec3  # [rad/s^2]
    force: Vec3  # [N]
    torque: Vec3  # [N m], gyroscopic part included


class LeafResult(NamedTuple):
    """What a leaf does."""

    acceleration: Vec3  # [m/s^2]
    angular_acceleration: Vec3  # [rad/s^2]
    spin: float  # s [rad/s^2]
    reaction_force: Vec3  # from the core on the leaf [N]
    reaction_torque: Vec3  # the same about the hinge point [N m]; along the axis: the drive torque


class Result(NamedTuple):
    """Accelerations of the core (linear of its centre of mass, angular) and its four leaves."""

    acceleration: Vec3
    angular_acceleration: Vec3
    leaves: tuple[LeafResult, LeafResult, LeafResult, LeafResult]


@leaf
def times(m, a):
    """m a for a symmetric matrix of six floats."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[4] * a[2],
        m[3] * a[0] + m[1] * a[1] + m[5] * a[2],
        m[4] * a[0] + m[5] * a[1] + m[2] * a[2],
    )


@leaf
def plus(m, n):
    """m + n."""
    return (m[0] + n[0], m[1] + n[1], m[2] + n[2], m[3] + n[3], m[4] + n[4], m[5] + n[5])


@leaf
def outer(s, a):
    """s a a^T for a scalar s."""
    x, y, z = s * a[0], s * a[1], s * a[2]
    return (x * a[0], y * a[1], z * a[2], x * a[1], x * a[2], y * a[2])


@leaf
def point_inertia(mass, a):
    """mass (|a|^2 1 - a a^T): the inertia of a point at a."""
    xx, yy, zz = mass * a[0] * a[0], mass * a[1] * a[1], mass * a[2] * a[2]
    return (yy + zz, xx + zz, xx + yy, -mass * a[0] * a[1], -mass * a[0] * a[2], -mass * a[1] * a[2])


@leaf
def rotated(R, moments):
    """R diag(moments) R^T."""
    x, y, z = moments
    return (
        x * R[0] * R[0] + y * R[1] * R[1] + z * R[2] * R[2],
        x * R[3] * R[3] + y * R[4] * R[4] + z * R[5] * R[5],
        x * R[6] * R[6] + y * R[7] * R[7] + z * R[8] * R[8],
        x * R[0] * R[3] + y * R[1] * R[4] + z * R[2] * R[5],
        x * R[0] * R[6] + y * R[1] * R[7] + z * R[2] * R[8],
        x * R[3] * R[6] + y * R[4] * R[7] + z * R[5] * R[8],
    )


@leaf
def felt(R, moments, spins):
    """The inertia of a leaf as its core feels it: without the moment about its z axis if it spins freely."""
    return rotated(R, (moments[0], moments[1], (1.0 - spins) * moments[2]))


@leaf
def solve_symmetric(m, b):
    """m^-1 b by cofactors."""
    c00 = m[1] * m[2] - m[5] * m[5]
    c01 = m[4] * m[5] - m[3] * m[2]
    c02 = m[3] * m[5] - m[4] * m[1]
    k = 1.0 / (m[0] * c00 + m[3] * c01 + m[4] * c02)
    c11 = m[0] * m[2] - m[4] * m[4]
    c12 = m[3] * m[4] - m[0] * m[5]
    c22 = m[0] * m[1] - m[3] * m[3]
    return scale(k, times((c00, c11, c22, c01, c02, c12), b))


@leaf
def _seen(l):  # noqa: E741
    """What the core sees of a leaf: (inertia, force, torque), eqs. (8.42), (8.43)."""
    inertia = plus(l.inertia, point_inertia(l.mass, l.offset))
    force = subtract(l.force, scale(l.mass, l.drift))
    torque = subtract(l.torque, times(l.inertia, l.turn))
    torque = subtract(torque, scale(l.spins * (l.drive_torque + dot(l.axis, l.torque)), l.axis))
    return inertia, force, add(torque, cross(l.offset, force))


@leaf
def _moved(l, a, alpha):  # noqa: E741
    """What the leaf does under the core's accelerations, eqs. (8.40), (8.41)."""
    turned = add(alpha, l.turn)
    acceleration = add(add(a, cross(alpha, l.offset)), l.drift)
    given = l.spins * (l.drive_torque + dot(l.axis, l.torque))
    # a leaf that is gone has nothing to divide by
    spin = given / l.axial - l.spins * dot(l.axis, turned) if l.axial > 0.0 else 0.0
    return LeafResult(
        acceleration,
        add(turned, scale(spin, l.axis)),
        spin,
        subtract(scale(l.mass, acceleration), l.force),
        subtract(add(times(l.inertia, turned), scale(given, l.axis)), l.torque),
    )


@leaf
def eliminate(core, leaves):
    """Accelerations of a core and its four leaves (theory.md, eqs. (8.44), (8.45))."""
    l1, l2, l3, l4 = leaves
    i1, f1, t1 = _seen(l1)
    i2, f2, t2 = _seen(l2)
    i3, f3, t3 = _seen(l3)
    i4, f4, t4 = _seen(l4)
    mass = core.mass + l1.mass + l2.mass + l3.mass + l4.mass
    moment = add(
        add(scale(l1.mass, l1.offset), scale(l2.mass, l2.offset)),
        add(scale(l3.mass, l3.offset), scale(l4.mass, l4.offset)),
    )
    force = add(core.force, add(add(f1, f2), add(f3, f4)))
    torque = add(core.torque, add(add(t1, t2), add(t3, t4)))
    inertia = plus(plus(core.inertia, point_inertia(-1.0 / mass, moment)), plus(plus(i1, i2), plus(i3, i4)))
    alpha = solve_symmetric(inertia, subtract(torque, scale(1.0 / mass, cross(moment, force))))
    a = scale(1.0 / mass, add(force, cross(moment, alpha)))
    moved = (_moved(l1, a, alpha), _moved(l2, a, alpha), _moved(l3, a, alpha), _moved(l4, a, alpha))
    return Result(a, alpha, moved)
