"""Accelerations, multipliers and rank against a dense pseudo-inverse, the embedding technique and both coordinates."""

import multibody_embedding as embedding
import numpy as np
import pytest
from multibody_angles import euler_from_quaternion

from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.multibody import augmented, pivoted_qr
from lapwing.dynamics.multibody.augmented import accelerations
from lapwing.dynamics.multibody.delivery_drone import delivery_drone
from lapwing.dynamics.multibody.five_bodies import BodyState, arrays, machine
from lapwing.dynamics.multibody.five_body_stabilisation import assembled_state
from lapwing.dynamics.multibody.mechanisms import bricard, drone_system
from lapwing.dynamics.multibody.stabilisation import rows
from lapwing.dynamics.multibody.system import assemble

pytestmark = pytest.mark.long

PAPER = {
    "central_frame": 8.0,
    "payload": 2.0,
    "frame_inertia": (0.27, 0.26, 0.42),
    "propeller": 5.6e-3,
    "propeller_inertia": (9.8e-6, 8.6e-4, 8.6e-4),
    "arm_length": 0.4974,
    "rotor_sign_x": (1, -1, -1, 1),
    "rotor_sign_y": (1, 1, -1, -1),
}


def state(rng):
    drone = delivery_drone(**PAPER, driven="speed")
    speeds = rng.uniform(-400.0, 400.0, 4)
    q = rng.normal(size=4)
    chassis = BodyState(
        tuple(rng.normal(size=3)),
        Quaternion(*map(float, q / np.linalg.norm(q))),
        tuple(rng.normal(size=3)),
        tuple(3 * rng.normal(size=3)),
    )
    x = assembled_state(machine(drone, (0.0, 0.0, -9.81)), chassis, tuple(rng.uniform(-3, 3, 4)), tuple(speeds))
    wrench = rng.normal(size=(5, 6)) * [10, 10, 10, 1, 1, 1]
    wrench[1:, 3:] *= 0.01
    return drone, *arrays(x), wrench, np.stack([speeds, 10.0 * rng.normal(size=4)], axis=1)


@pytest.mark.parametrize(("driven", "rank", "count"), [(True, 24, 32), (False, 20, 20)])
def test_drone_against_dense_pseudo_inverse(driven, rank, count):
    """30 coordinates, 32 rows of rank 24: unique accelerations, shortest multipliers; 10 undriven freedoms."""
    rng = np.random.default_rng(5)
    for _ in range(5):
        drone, q, v, wrench, drive = state(rng)
        system = drone_system(drone, (driven,) * 4)
        drive = drive if driven else drive[:0]
        ours = accelerations(system, q, v, wrench, drive)
        p, e = rows(system.arrays, q, v, drive)
        M, J = embedding.mass_matrix(system, p), e.jacobian_t.T
        assert (len(J), ours.rank) == (count, rank)
        Q = augmented.generalised_force(system.arrays, p, wrench).ravel()
        # shortest multipliers by the pseudo-inverse of the Schur complement, scaled once to keep its digits
        free = np.linalg.solve(M, Q)
        multipliers = np.linalg.pinv(J @ np.linalg.solve(M, J.T), rcond=1e-13, hermitian=True) @ (J @ free - e.gamma)
        a = np.linalg.solve(M, Q - J.T @ multipliers)
        scale = np.abs(a).max()
        np.testing.assert_allclose(ours.acceleration.ravel() / scale, a / scale, atol=1e-9)
        np.testing.assert_allclose(ours.multipliers, multipliers, atol=1e-8 * np.abs(multipliers).max())
        assert ours.conflict < 1e-11 * scale


def test_normal_equations_lose_digits_that_factorisation_keeps():
    """The baseline, one LU of the assembled 62 x 62 matrix, fails because the matrix is singular."""
    drone, q, v, wrench, drive = state(np.random.default_rng(8))
    system = drone_system(drone)
    p, e = rows(system.arrays, q, v, drive)
    M, J = embedding.mass_matrix(system, p), e.jacobian_t.T
    saddle = np.block([[M, J.T], [J, np.zeros((32, 32))]])
    assert np.linalg.matrix_rank(saddle) == 54
    ours = accelerations(system, q, v, wrench, drive).acceleration.ravel()
    assert np.abs(J @ ours - e.gamma).max() < 1e-10 * np.abs(e.gamma).max()


@pytest.mark.parametrize("driven", [True, False])
def test_embedding_technique_agrees_with_augmented_form(driven):
    rng = np.random.default_rng(6)
    for _ in range(5):
        drone, q, v, wrench, drive = state(rng)
        system = drone_system(drone, (driven,) * 4)
        drive = drive if driven else None
        first, second = accelerations(system, q, v, wrench, drive), embedding.accelerations(system, q, v, wrench, drive)
        assert second.mass.shape == ((6, 6) if driven else (10, 10))
        scale = np.abs(first.acceleration).max()
        np.testing.assert_allclose(second.acceleration / scale, first.acceleration / scale, atol=1e-12)


def test_euler_angles_and_quaternions_have_same_motion():
    """theta'' of the Euler form, converted to omega', equals omega' of the quaternion form."""
    rng = np.random.default_rng(7)
    for _ in range(5):
        drone, q, v, wrench, drive = state(rng)
        system = drone_system(drone)
        angles, rates = euler_from_quaternion(q, v)
        first = accelerations(system, q, v, wrench, drive).acceleration
        second = accelerations(system, angles, rates, wrench, drive)
        p, _ = rows(system.arrays, angles, rates, drive)
        omega_rate = np.einsum("bij,bj->bi", p.rate_matrix.reshape(5, 3, 3), second.acceleration[:, 3:]) + p.bias
        scale = np.abs(first).max()
        np.testing.assert_allclose(second.acceleration[:, :3] / scale, first[:, :3] / scale, atol=1e-11)
        # the propellers' pitch may come close to 90 degrees: the mass matrix's condition is 1 / cos^2
        np.testing.assert_allclose(omega_rate / scale, first[:, 3:] / scale, atol=1e-9)
        assert second.rank == 24


def test_singular_euler_angles_are_found_before_dividing():
    drone, q, v, _, drive = state(np.random.default_rng(9))
    q[0, 3:] = [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]
    with pytest.raises(ValueError, match="body 0: pitch is at 90 degrees"):
        euler_from_quaternion(q, v)
    angles = np.zeros((5, 6))
    angles[0, 4] = np.pi / 2
    with pytest.raises(ValueError, match="chassis: pitch reached 90 degrees"):
        accelerations(drone_system(drone), angles, v, None, drive)


def test_bricards_redundant_row_is_found():
    system, q, v = bricard()
    solution = accelerations(system, q, v)
    assert (len(system.row_names()), solution.rank) == (30, 29)


def test_contradicting_drives_are_reported():
    """`conflict` reports two drives that impose different accelerations on one pair."""
    drone, q, v, _, drive = state(np.random.default_rng(10))
    system = drone_system(drone)
    twice = type(system.drives[0])("second", 1, 0, (0.0, 0.0, 1.0))
    system = assemble(system.bodies, system.joints, (*system.drives, twice))
    agreeing = np.vstack([drive, drive[:1]])
    contradicting = np.vstack([drive, drive[:1] + np.array([0.0, 5.0])])
    assert accelerations(system, q, v, None, agreeing).conflict < 1e-8
    assert accelerations(system, q, v, None, contradicting).conflict > 1e-3


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda q, v, w: (q[:4], v, w), r"configuration must have shape \(5, 6\) or \(5, 7\)"),
        (lambda q, v, w: (q, v[:, :3], w), r"velocity must have shape \(5, 6\)"),
        (lambda q, v, w: (q, v * np.nan, w), "velocity contains a number that is not finite in row 0"),
    ],
)
def test_invalid_arguments_are_rejected(change, message):
    drone, q, v, wrench, drive = state(np.random.default_rng(11))
    with pytest.raises(ValueError, match=message):
        accelerations(drone_system(drone), *change(q, v, wrench), drive)


def test_round_off_column_is_not_independent():
    B = np.diag([1.0, 2.0, 1e-17])
    assert pivoted_qr.factor(B, 1e-9, augmented.ANY).rank == 2


def test_pivoted_qr_solves_rank_deficient_problem():
    rng = np.random.default_rng(12)
    B = rng.normal(size=(6, 4)) @ rng.normal(size=(4, 9))
    f = pivoted_qr.factor(B, 1e-9, augmented.ANY)
    assert f.rank == 4
    right = B.T @ rng.normal(size=6)
    y, z, conflict = pivoted_qr.shortest(f, right)
    np.testing.assert_allclose(y, np.linalg.pinv(B.T) @ right, atol=1e-12)
    assert conflict < 1e-12
    np.testing.assert_allclose(pivoted_qr.minimum_norm(f, z), np.linalg.pinv(B) @ y, atol=1e-12)
    x = pivoted_qr.basic(f, y)
    np.testing.assert_allclose(B @ x, y, atol=1e-12)
    assert np.count_nonzero(x) == 4
