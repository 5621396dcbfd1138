"""Control allocation: each rotor's share of every demand, for rotors at any place (theory.md, eq. (4.27)).

The least thrusts, in the sum of their squares, that give the wanted lift and torques: the pseudo-inverse of the
effectiveness matrix, scaled so that four rotors in a cross get shares of +1 and -1.
"""

import numpy as np

from dynamics.vector import Vec3
from services.autopilot.interface import PerRotor
from services.autopilot.mixer import Share, Shares

LEAST_LIFT = 0.05  # share of the lift that every rotor must have in hover, to be turned down for control
WORST_CONDITION = 1e3  # of the scaled effectiveness, above which a torque counts as one that the rotors cannot give
YAW = 3  # row of the effectiveness


def effectiveness(rotor_x: PerRotor, rotor_y: PerRotor, rotor_yaw: PerRotor) -> np.ndarray:
    """Lift [N] and torques about body x, y, z [N m] of 1 N of thrust of every rotor: shape (4, rotors).

    Args:
        rotor_x: [m] body.
        rotor_y: [m] body.
        rotor_yaw: torque about body z of 1 N of thrust [m].
    """
    return np.array([np.ones(len(rotor_x)), rotor_y, -np.array(rotor_x), rotor_yaw])


def tilted_effectiveness(positions: tuple[Vec3, ...], axes: tuple[Vec3, ...], rotor_reaction: PerRotor) -> np.ndarray:
    """The same for rotors that push along axes of their own (theory.md, eq. (4.27a)).

    Args:
        positions: [m] body.
        axes: unit vectors in the body.
        rotor_reaction: torque about its axis of 1 N of thrust [m].
    """
    axis = np.array(axes)
    torques = np.cross(positions, axis) + np.array(rotor_reaction)[:, None] * axis
    return np.vstack([axis[:, 2], torques.T])


def demand_effects(B: np.ndarray) -> np.ndarray:
    """Lift [N] and torques [N m] of demands of 1 N: rotors times mean arm, shape (4,).

    Args:
        B: `effectiveness` of the rotors, shape (4, rotors).
    """
    return np.array([sum(abs(float(v)) for v in row) for row in B])


def shares_of(B: np.ndarray, failed: int = 0) -> Shares | None:
    """(collective, roll, pitch, yaw) share of every rotor in the demands; None where they cannot hover in balance.

    Where the rotors that are left after a failure cannot give yaw torque beside the others, it is given up: its shares
    are 0.

    Args:
        B: `effectiveness` of the rotors, shape (4, rotors).
        failed: number of the rotor that gives nothing, from 1; 0: none.
    """
    effects = demand_effects(B)
    if effects.min() <= 0.0:
        return None
    scaled = B / effects[:, None]
    left = [k for k in range(scaled.shape[1]) if k != failed - 1]
    for rows in ([0, 1, 2, YAW], [0, 1, 2]) if failed else ([0, 1, 2, YAW],):
        some = scaled[np.ix_(rows, left)]
        gram = some @ some.T
        if np.linalg.cond(gram) > WORST_CONDITION**2:
            continue
        shares = np.zeros((scaled.shape[1], 4))
        shares[np.ix_(left, rows)] = some.T @ np.linalg.inv(gram)
        if shares[left, 0].min() >= LEAST_LIFT:
            return tuple(_share(row) for row in shares)
    return None


def tables(B: np.ndarray) -> tuple[Shares, ...]:
    """Shares with all rotors, then with each one failed; with all rotors alone where one that fails ends control.

    It does so where four rotors fly, and where two stand over one another, since what the gyroscopes say does not tell
    which of both has failed.

    Raises:
        ValueError: the rotors cannot hover in balance, or give no torque about an axis.
    """
    whole, count = shares_of(B), B.shape[1]
    if whole is None:
        expected = "lift from each in hover, and torques about all three axes that do not come with one another"
        raise ValueError(f"the {count} rotors cannot be balanced; expected {expected}")
    if len(np.unique(B[:YAW], axis=1).T) < count:
        return (whole,)
    found = [shares for k in range(1, count + 1) if (shares := shares_of(B, k)) is not None]
    return (whole, *found) if len(found) == count else (whole,)


def _share(row: np.ndarray) -> Share:
    collective, roll, pitch, yaw = map(float, row)
    return collective, roll, pitch, yaw
