"""Equations of the joints and drives: residuals, Jacobian and quadratic velocity vector.

Rows are the holonomic equations of all joints (five each), then the nonholonomic ones of all drives (three each).
Columns are the bodies' twists (velocity_world, omega_body), six for each body, the ground last; the Jacobian is stored
transposed, so that the solver runs along memory.
"""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.multibody.body_kinematics import nine, three
from lapwing.dynamics.vector import add, apply, apply_transposed, cross, dot, scale, subtract
from lapwing.kernels import kernel, noinline


class Equations(NamedTuple):
    """The m constraint rows at one state: J twist = target, J d(twist)/dt = gamma, position residual = 0."""

    jacobian_t: np.ndarray  # (6 (n + 1), m)
    residual: np.ndarray  # (5 k,) of the holonomic rows on position level [m, -]
    target: np.ndarray  # (m,) right-hand side on velocity level [rad/s], zero except for drives
    gamma: np.ndarray  # (m,) quadratic velocity vector


@kernel
def _revolute(a, p, k, out):
    """Write the rows of joint k (theory, eqs. (8.10)-(8.13))."""
    i, j = a.joint_bodies[k]
    r = 5 * k
    Ri, Rj, wi, wj = nine(p.rotation, i), nine(p.rotation, j), three(p.omega, i), three(p.omega, j)
    ui, uj = three(a.joint_points[k], 0), three(a.joint_points[k], 1)
    gap = subtract(add(three(p.position, i), apply(Ri, ui)), add(three(p.position, j), apply(Rj, uj)))
    ai = apply(Ri, cross(wi, cross(wi, ui)))
    aj = apply(Rj, cross(wj, cross(wj, uj)))
    ci, cj = 6 * (i % p.position.shape[0]), 6 * (j % p.position.shape[0])
    for row in range(3):
        out.residual[r + row] = gap[row]
        out.gamma[r + row] = aj[row] - ai[row]
        out.jacobian_t[ci + row, r + row] = 1.0
        out.jacobian_t[cj + row, r + row] = -1.0
        # row of A, crossed with the point: A (omega x u) = -(A u~) omega
        li = cross(ui, (Ri[3 * row], Ri[3 * row + 1], Ri[3 * row + 2]))
        lj = cross(uj, (Rj[3 * row], Rj[3 * row + 1], Rj[3 * row + 2]))
        for c in range(3):
            out.jacobian_t[ci + 3 + c, r + row] = li[c]
            out.jacobian_t[cj + 3 + c, r + row] = -lj[c]
    v3_body = three(a.joint_triads[k, 1], 2)
    v3 = apply(Rj, v3_body)
    v3_rate = apply(Rj, cross(wj, v3_body))
    v3_quadratic = apply(Rj, cross(wj, cross(wj, v3_body)))
    for row in range(2):
        v_body = three(a.joint_triads[k, 0], row)
        v = apply(Ri, v_body)
        v_rate = apply(Ri, cross(wi, v_body))
        v_quadratic = apply(Ri, cross(wi, cross(wi, v_body)))
        out.residual[r + 3 + row] = dot(v, v3)
        out.gamma[r + 3 + row] = -dot(v3, v_quadratic) - 2.0 * dot(v_rate, v3_rate) - dot(v, v3_quadratic)
        # d(v . v3)/dt = omega_i . (v x v3) - omega_j . (v x v3), each in the axes of its body
        normal = cross(v, v3)
        di, dj = apply_transposed(Ri, normal), apply_transposed(Rj, normal)
        for c in range(3):
            out.jacobian_t[ci + 3 + c, r + 3 + row] = di[c]
            out.jacobian_t[cj + 3 + c, r + 3 + row] = -dj[c]


@kernel
def _drive(a, p, k, speed, acceleration, out):
    """Write the rows of drive k (theory, eqs. (8.15)-(8.17))."""
    i, j = a.drive_bodies[k]
    r = 5 * len(a.joint_bodies) + 3 * k
    Ri, Rj = nine(p.rotation, i), nine(p.rotation, j)
    ci, cj = 6 * (i % p.position.shape[0]), 6 * (j % p.position.shape[0])
    axis = apply(Rj, three(a.drive_axes, k))
    omega_j = apply(Rj, three(p.omega, j))
    gamma = add(scale(acceleration, axis), cross(omega_j, scale(speed, axis)))
    for row in range(3):
        out.target[r + row] = speed * axis[row]
        out.gamma[r + row] = gamma[row]
        for c in range(3):
            out.jacobian_t[ci + 3 + c, r + row] = Ri[3 * row + c]
            out.jacobian_t[cj + 3 + c, r + row] = -Rj[3 * row + c]


@noinline
def equations(a, p, drive):
    """Return all rows at a placement, for imposed (speed [rad/s], acceleration [rad/s^2]) per drive, shape (d, 2)."""
    k, d = len(a.joint_bodies), len(a.drive_bodies)
    m = 5 * k + 3 * d
    out = Equations(np.zeros((6 * len(p.position), m)), np.zeros(5 * k), np.zeros(m), np.zeros(m))
    for joint in range(k):
        _revolute(a, p, joint, out)
    for index in range(d):
        _drive(a, p, index, drive[index, 0], drive[index, 1], out)
    return out


@noinline
def in_coordinates(e, p):
    """Return the rows for the coordinates' rates, without ground columns: J <- J G, gamma <- gamma - J bias.

    See theory, eq. (8.14); rows for quaternions, whose velocities are the twists, are unchanged.
    """
    n = len(p.rate_matrix)
    Jt = e.jacobian_t[: 6 * n]
    gamma = e.gamma.copy()
    for b in range(n):
        G, bias = nine(p.rate_matrix, b), three(p.bias, b)
        base = 6 * b + 3
        for r in range(Jt.shape[1]):
            row = (Jt[base, r], Jt[base + 1, r], Jt[base + 2, r])
            gamma[r] -= dot(row, bias)
            mapped = apply_transposed(G, row)
            for c in range(3):
                Jt[base + c, r] = mapped[c]
    return Equations(Jt, e.residual, e.target, gamma)


@kernel
def velocity_defect(e, velocity):
    """Return J velocity - target, shape (m,)."""
    flat = velocity.reshape(-1)
    out = -e.target
    for c in range(len(flat)):
        for r in range(len(out)):
            out[r] += e.jacobian_t[c, r] * flat[c]
    return out
