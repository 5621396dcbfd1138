"""Fast path: one core body and four leaves hinged to it at their centres of mass, without assembled matrices.

The leaves are eliminated into the core's equations (theory, eqs. (8.40)-(8.45)), all four at once: every number of a
`HingedBody` is a SIMD vector with one lane for each leaf. The remaining system is symmetric, 3x3. All vectors are in
the same axes, which are arbitrary. A symmetric matrix is six numbers (xx, yy, zz, xy, xz, yz).
"""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3, add, cross, dot, scale, subtract
from lapwing.kernels import always_inline
from lapwing.kernels.simd import horizontal_sum

Sym3 = tuple[float, float, float, float, float, float]


class Core(NamedTuple):
    """Core body and its loads."""

    mass: float  # [kg]
    inertia: Sym3  # [kg m^2]
    force: Vec3  # [N]
    torque: Vec3  # [N m], gyroscopic part included


class HingedBody(NamedTuple):
    """Leaves, their relative motion and their loads.

    a_leaf = a + alpha x offset + drift, alpha_leaf = alpha + turn + s axis. A detached leaf has no mass, no inertia and
    no loads.
    """

    mass: float  # [kg]
    inertia: Sym3  # about its centre of mass [kg m^2]; without the axial moment if it spins freely, eq. (8.42)
    offset: Vec3  # hinge point from the core's centre of mass [m]
    axis: Vec3  # unit vector, a principal axis of the inertia
    axial: float  # moment of inertia about the axis [kg m^2], never zero
    spins: float  # 1: s follows from `drive_torque`; 0: s = 0, `turn` is imposed completely
    drive_torque: float  # [N m] about the axis, from the core on the leaf; ignored if s = 0
    drift: Vec3  # [m/s^2]
    turn: Vec3  # [rad/s^2]
    force: Vec3  # [N]
    torque: Vec3  # [N m], gyroscopic part included


class Result(NamedTuple):
    """Accelerations of the core (of its centre of mass, angular), and motion and reactions of the leaves."""

    acceleration: Vec3  # [m/s^2]
    angular_acceleration: Vec3  # [rad/s^2]
    relative: Vec3  # acceleration of the leaves less that of the core [m/s^2]
    turned: Vec3  # angular acceleration of the leaves [rad/s^2]
    spin: float  # s [rad/s^2]
    reaction_force: Vec3  # from the core on the leaves [N]
    reaction_torque: Vec3  # torque about the hinge point [N m]; its component along the axis is the drive torque


@always_inline
def times(m, a):
    """Return m a for a symmetric matrix of six floats."""
    return (
        m[0] * a[0] + m[3] * a[1] + m[4] * a[2],
        m[3] * a[0] + m[1] * a[1] + m[5] * a[2],
        m[4] * a[0] + m[5] * a[1] + m[2] * a[2],
    )


@always_inline
def plus(m, n):
    """Return m + n."""
    return (m[0] + n[0], m[1] + n[1], m[2] + n[2], m[3] + n[3], m[4] + n[4], m[5] + n[5])


@always_inline
def outer(s, a):
    """Return s a a^T for a scalar s."""
    x, y, z = s * a[0], s * a[1], s * a[2]
    return (x * a[0], y * a[1], z * a[2], x * a[1], x * a[2], y * a[2])


@always_inline
def point_inertia(mass, a):
    """Return mass (|a|^2 1 - a a^T): the inertia of a point at a."""
    xx, yy, zz = mass * a[0] * a[0], mass * a[1] * a[1], mass * a[2] * a[2]
    return (yy + zz, xx + zz, xx + yy, -mass * a[0] * a[1], -mass * a[0] * a[2], -mass * a[1] * a[2])


@always_inline
def reflected_inertia(C, moments, spins):
    """Return the inertia of a leaf reflected to its core: C diag(moments) C^T for a rotation matrix C.

    Without the moment about the leaf's z axis if it spins freely.
    """
    # C diag(1, 1, 1) C^T = 1 saves a column
    along = outer(moments[0] - moments[1], (C[0], C[3], C[6]))
    about = outer((1.0 - spins) * moments[2] - moments[1], (C[2], C[5], C[8]))
    x, y, z, xy, xz, yz = plus(along, about)
    return (x + moments[1], y + moments[1], z + moments[1], xy, xz, yz)


@always_inline
def solve_symmetric(m, b):
    """Return m^-1 b by cofactors."""
    c00 = m[1] * m[2] - m[5] * m[5]
    c01 = m[4] * m[5] - m[3] * m[2]
    c02 = m[3] * m[5] - m[4] * m[1]
    k = 1.0 / (m[0] * c00 + m[3] * c01 + m[4] * c02)
    c11 = m[0] * m[2] - m[4] * m[4]
    c12 = m[3] * m[4] - m[0] * m[5]
    c22 = m[0] * m[1] - m[3] * m[3]
    return scale(k, times((c00, c11, c22, c01, c02, c12), b))


@always_inline
def _all(a):
    """Return the sum over the four lanes of each of the three components of a vector."""
    return (horizontal_sum(a[0]), horizontal_sum(a[1]), horizontal_sum(a[2]))


@always_inline
def _sum(m):
    """Return the sum over the four lanes of each of the six entries of a symmetric matrix."""
    return (
        horizontal_sum(m[0]),
        horizontal_sum(m[1]),
        horizontal_sum(m[2]),
        horizontal_sum(m[3]),
        horizontal_sum(m[4]),
        horizontal_sum(m[5]),
    )


@always_inline
def eliminate(core, leaf):
    """Return accelerations of a core and its four leaves (theory, eqs. (8.44), (8.45))."""
    drive = leaf.spins * (leaf.drive_torque + dot(leaf.axis, leaf.torque))
    force = subtract(leaf.force, scale(leaf.mass, leaf.drift))
    torque = subtract(leaf.torque, add(times(leaf.inertia, leaf.turn), scale(drive, leaf.axis)))
    mass, moment = core.mass + horizontal_sum(leaf.mass), _all(scale(leaf.mass, leaf.offset))
    inverse = 1.0 / mass
    points = point_inertia(leaf.mass, leaf.offset)
    fixed = plus(core.inertia, plus(point_inertia(-inverse, moment), _sum(points)))
    whole_force = add(core.force, _all(force))
    whole_torque = add(core.torque, _all(add(torque, cross(leaf.offset, force))))
    alpha = solve_symmetric(
        plus(fixed, _sum(leaf.inertia)), subtract(whole_torque, scale(inverse, cross(moment, whole_force)))
    )
    a = scale(inverse, add(whole_force, cross(moment, alpha)))
    # back to the leaves, eqs. (8.40), (8.41)
    turned = add(alpha, leaf.turn)
    relative = add(cross(alpha, leaf.offset), leaf.drift)
    spin = drive * (1.0 / leaf.axial) - leaf.spins * dot(leaf.axis, turned)
    return Result(
        a,
        alpha,
        relative,
        add(turned, scale(spin, leaf.axis)),
        spin,
        subtract(scale(leaf.mass, add(a, relative)), leaf.force),
        subtract(add(times(leaf.inertia, turned), scale(drive, leaf.axis)), leaf.torque),
    )
