"""Control allocation for arbitrary rotor positions (theory, eq. (4.27)).

The least-squares thrusts of the desired lift and torques: the pseudo-inverse of the effectiveness matrix, scaled so
that four rotors in a cross get shares of +1 and -1. Thrusts are those of isolated rotors; the effectiveness matrix
includes the losses in the wakes of other rotors.
"""

from collections.abc import Mapping

import numpy as np

from lapwing.dynamics.effects._types import WakeSlopes
from lapwing.dynamics.small_matrices import inverse, product, symmetric_eigenvalues
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import math
from lapwing.services.autopilot.mixer import Share, Shares
from lapwing.services.common.ports import PerRotor

LEAST_LIFT = 0.05  # minimum share of the hover lift per rotor, which leaves room for control
WORST_CONDITION = 1e3  # condition number of the scaled effectiveness above which a torque is uncontrollable
ARM_DIGITS = 9  # decimals of arms [m] for the comparison of coaxial rotors
YAW = 3  # row of the effectiveness


def effectiveness(rotor_x: PerRotor, rotor_y: PerRotor, rotor_yaw: PerRotor) -> np.ndarray:
    """Return lift [N] and torques about body x, y, z [N m] per 1 N of thrust of every rotor, shape (4, rotors).

    Args:
        rotor_x: [m] body.
        rotor_y: [m] body.
        rotor_yaw: torque about body z per 1 N of thrust [m].
    """
    return np.array([np.ones(len(rotor_x)), rotor_y, -np.array(rotor_x), rotor_yaw])


def tilted_effectiveness(positions: tuple[Vec3, ...], axes: tuple[Vec3, ...], rotor_reaction: PerRotor) -> np.ndarray:
    """Return the effectiveness of tilted rotors, shape (4, rotors) (theory, eq. (4.27a)).

    Args:
        positions: [m] body.
        axes: unit vectors of thrust, body.
        rotor_reaction: torque about its axis per 1 N of thrust [m].
    """
    axis = np.array(axes)
    torques = np.cross(positions, axis) + np.array(rotor_reaction)[:, None] * axis
    return np.vstack([axis[:, 2], torques.T])


def wake_effectiveness(
    thrust_only: np.ndarray, reaction: np.ndarray, torque_per_thrust: float, wakes: WakeSlopes
) -> np.ndarray:
    """Return the effectiveness of rotors in the wakes of others, shape (4, rotors) (theory, eq. (4.27b)).

    Args:
        thrust_only: `effectiveness` of the rotors without reaction torques, shape (4, rotors).
        reaction: torques about body x, y, z per 1 N m of each rotor's reaction, below a row of 0; shape (4, rotors).
        torque_per_thrust: [m] of an isolated rotor.
        wakes: slopes with a row and a column per rotor.
    """
    thrust, torque = np.array(wakes.thrust), np.array(wakes.torque)
    return product(thrust_only, thrust) + product(reaction, torque_per_thrust * np.eye(len(thrust)) + torque)


def virtual_control_effectiveness(B: np.ndarray) -> np.ndarray:
    """Return lift [N] and torques [N m] of virtual controls of 1 N: rotors times mean arm, shape (4,).

    Args:
        B: `effectiveness` of the rotors, shape (4, rotors).
    """
    return np.array([math.total(abs(float(v)) for v in row) for row in B])


def rotor_shares(B: np.ndarray, failed: int = 0, weights: np.ndarray | None = None) -> Shares | None:
    """Return the (collective, roll, pitch, yaw) share of every rotor. Return None if a balanced hover is impossible.

    If the remaining rotors after a failure cannot control yaw too, the yaw shares are 0.

    Args:
        B: `effectiveness` of the rotors, shape (4, rotors).
        failed: number of the failed rotor, from 1; 0: none.
        weights: weights of the squared thrusts, shape (rotors,); default 1.
    """
    effects = virtual_control_effectiveness(B)
    if effects.min() <= 0.0:
        return None
    root = np.sqrt(np.ones(B.shape[1]) if weights is None else weights)
    scaled = B / effects[:, None] / root
    remaining = [k for k in range(scaled.shape[1]) if k != failed - 1]
    for rows in ([0, 1, 2, YAW], [0, 1, 2]) if failed else ([0, 1, 2, YAW],):
        selected = scaled[np.ix_(rows, remaining)]
        gram = product(selected, selected.T)
        smallest, *_, largest = symmetric_eigenvalues(gram)
        if not smallest * math.square(WORST_CONDITION) >= largest:
            continue
        shares = np.zeros((scaled.shape[1], 4))
        shares[np.ix_(remaining, rows)] = product(selected.T, inverse(gram)) / root[remaining, None]
        if shares[remaining, 0].min() >= LEAST_LIFT:
            return tuple(_share(row) for row in shares)
    return None


def tables(B: np.ndarray, weights: np.ndarray | None = None) -> tuple[Shares, ...]:
    """Return the shares with all rotors, then with each one failed. See `rotor_shares` for arguments.

    Only the first table is returned if a failed rotor ends control, as with four rotors, or cannot be identified by
    the gyroscopes, as with coaxial rotors.

    Raises:
        ValueError: a balanced hover is impossible, or no torque acts about an axis.
    """
    whole, count = rotor_shares(B, 0, weights), B.shape[1]
    if whole is None:
        expected = "lift from each rotor in hover, and independent torques about all three axes"
        raise ValueError(f"the {count} rotors cannot be balanced; expected {expected}")
    arms = np.round(B[1:YAW] / B[0], ARM_DIGITS)
    if len(np.unique(arms, axis=1).T) < count:
        return (whole,)
    reduced = [shares for k in range(1, count + 1) if (shares := rotor_shares(B, k, weights)) is not None]
    return (whole, *reduced) if len(reduced) == count else (whole,)


def tables_for_failures(tables: tuple[Shares, ...], values: Mapping[str, float]) -> tuple[Shares, ...]:
    """Return the shares in use after failures, one table per case; those of all rotors if CA_FAILURE_MODE is 0."""
    ignored = values.get("CA_FAILURE_MODE", 1.0) == 0.0  # not in logs of former versions
    return tables[:1] * len(tables) if ignored else tables


def _share(row: np.ndarray) -> Share:
    collective, roll, pitch, yaw = map(float, row)
    return collective, roll, pitch, yaw
