"""IFToMM benchmark mechanisms in the general engine, against closed forms of their one degree of freedom.

A01: elliptic integral. A02: the linkage is a pendulum, by any N. A04: the trihedral Bricard loop's closure
cos a + cos b + cos a cos b = 0 (Chen, You, Tarnai, Int. J. Solids Structures 42 (2005) 2287, alpha = 90 degrees)
gives the energy integral of the motion.
"""

import math

import numpy as np
import pytest
from multibody_energy import energy
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from lapwing.dynamics.multibody.mechanisms import GRAVITY, Z, bricard, four_bars
from lapwing.dynamics.multibody.simulation import simulate
from lapwing.dynamics.multibody.system import GROUND, Body, Revolute, assemble

G = 9.81


def pendulum():
    """Return A01: 1 kg at 1 m from a hinge, released at rest from the horizontal, with a small inertia."""
    hinge = Revolute("hinge", GROUND, 0, (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), Z, Z)
    system = assemble([Body("mass", 1.0, (1e-9,) * 3)], [hinge], gravity=GRAVITY)
    return system, np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 6))


def drift(system, motion):
    total = [sum(energy(system, q, v)) for q, v in zip(motion.configuration, motion.velocity, strict=True)]
    return max(total) - min(total)


def test_a01_pendulum_period_and_energy():
    """After ten periods 4 sqrt(l / g) K(sin^2(45 deg)) the mass is back; the energy drifts below 1e-6 J in 24 s."""
    system, q, v = pendulum()
    period = 4.0 * math.sqrt(1.0 / G) * ellipk(0.5)
    steps = 4000
    motion = simulate(system, q, v, 10.0 * period / steps, steps, record_every=100)
    np.testing.assert_allclose(motion.configuration[-1, 0, :3], [1.0, 0.0, 0.0], atol=1e-5)
    half = motion.configuration[18, 0]
    np.testing.assert_allclose(half[:3], [-1.0, 0.0, 0.0], atol=1e-5)
    assert drift(system, motion) < 1e-6
    assert motion.position_defect.max() < 1e-12


def a02_angle(n, speed, times):
    """Return the crank angle from the upright: (inertia) theta'' = m g l (weight) sin(theta), integrated to 1e-13."""
    inertia = (n + 1) * (1.0 / 12.0 + 0.25) + n
    weight = G * ((n + 1) * 0.5 + n)
    result = solve_ivp(
        lambda t, y: [y[1], weight / inertia * math.sin(y[0])],
        (0.0, times[-1]),
        [0.0, speed],
        "DOP853",
        times,
        rtol=1e-13,
        atol=1e-13,
    )
    return result.y[0]


def test_a02_four_bars_pass_their_singular_position():
    """The cranks turn over several times, twice a turn through the position with N more degrees of freedom.

    The tip of the first crank (B0) is well within the benchmark's 1e-3, and the cranks stay parallel.
    """
    n, end, steps = 2, 5.0, 2500
    system, q, v = four_bars(n)
    motion = simulate(system, q, v, end / steps, steps, record_every=50)
    theta = a02_angle(n, 1.0, motion.time)
    assert theta[-1] > 4.0 * math.pi  # four passes and more
    tip = 2.0 * motion.configuration[:, 0, :3]  # the crank's middle is half way
    np.testing.assert_allclose(tip, np.stack([np.sin(theta), np.cos(theta), 0 * theta], axis=1), atol=1e-6)
    last = 2.0 * (motion.configuration[:, n, :3] - [n, 0, 0])
    np.testing.assert_allclose(last, tip, atol=1e-6)
    assert drift(system, motion) < 1e-5
    assert motion.position_defect.max() < 1e-12


CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], float)
AXES = np.array([(0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 0)], float)


def bricard_at(fold):
    """Return rod centres (5, 3), last corner (3,), last axis (3,) and reduced inertia [kg m^2] of the loop whose odd
    hinges have turned by -`fold` from the cube: the even ones follow from the closure."""
    a = 0.5 * math.pi + fold
    b = math.acos(-math.cos(a) / (1.0 + math.cos(a)))
    ratio = -math.sin(a) * (1.0 + math.cos(b)) / (math.sin(b) * (1.0 + math.cos(a)))
    R, point, omega, velocity, inertia = np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    middles = []
    for k, rod in enumerate(np.diff(CORNERS, axis=0)):
        turn, rate = (-fold, -1.0) if k % 2 == 0 else (0.5 * math.pi - b, -ratio)
        omega = omega + R @ AXES[k] * rate
        R = R @ Rotation.from_rotvec(turn * AXES[k]).as_matrix()
        along = R @ rod
        middles.append(point + 0.5 * along)
        middle_velocity = velocity + 0.5 * np.cross(omega, along)
        axial = omega @ along
        inertia += middle_velocity @ middle_velocity + 1.01 / 12.0 * (omega @ omega - axial**2) + 0.01 / 6.0 * axial**2
        point, velocity = point + along, velocity + np.cross(omega, along)
    return np.array(middles), point, R @ AXES[5], inertia


def test_a04_bricard_follows_its_closure_and_its_energy_integral():
    """10 s of the benchmark: positions, speed and period of a loop with one redundant row."""
    system, q, v = bricard()
    motion = simulate(system, q, v, 2e-3, 5000, record_every=20)
    assert drift(system, motion) < 1e-5
    assert motion.position_defect.max() < 1e-12
    folds = []
    for configuration, velocity in zip(motion.configuration, motion.velocity, strict=True):
        R = Rotation.from_quat(configuration[0, 3:], scalar_first=True).as_matrix()
        fold = -math.atan2(R[0, 2], R[0, 0])
        middles, corner, axis, inertia = bricard_at(fold)
        np.testing.assert_allclose(corner, CORNERS[5], atol=1e-12)  # the closed form does close
        np.testing.assert_allclose(axis, AXES[5], atol=1e-12)
        np.testing.assert_allclose(configuration[:, :3], middles, atol=1e-9)
        fallen = -3.0 - middles[:, 1].sum()
        assert 0.5 * inertia * velocity[0, 4] ** 2 == pytest.approx(G * fallen, abs=1e-5)
        folds.append(fold)
    # from rest to the far turning point, where the rods are as high as on the cube: half a period by quadrature
    sign = math.copysign(1.0, folds[1])
    far = brentq(lambda fold: -3.0 - bricard_at(fold)[0][:, 1].sum(), sign * 2.5, sign * 3.5)

    def slowness(u):  # fold = far (1 - cos u) / 2 takes the square-root singularities out
        middles, _, _, inertia = bricard_at(far * 0.5 * (1.0 - math.cos(u)))
        return math.sqrt(inertia / (2.0 * G * (-3.0 - middles[:, 1].sum()))) * abs(far) * 0.5 * math.sin(u)

    half = quad(slowness, 1e-5, math.pi - 1e-5, epsabs=1e-9)[0] + 1e-5 * (slowness(1e-5) + slowness(math.pi - 1e-5))
    after = simulate(system, q, v, half / 1000, 2000, record_every=1000)
    assert abs(after.velocity[1]).max() < 1e-3
    np.testing.assert_allclose(after.configuration[1, :, :3], bricard_at(far)[0], atol=1e-5)
    np.testing.assert_allclose(after.configuration[2, :, :3], q[:, :3], atol=1e-5)
