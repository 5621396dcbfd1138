"""Reaction forces of the joints and torques of the drives, from the multipliers of a solution."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.multibody.augmented import Solution, as_float_arrays, raise_if_singular
from lapwing.dynamics.multibody.body_kinematics import place
from lapwing.dynamics.multibody.constraints import equations


class Reaction(NamedTuple):
    """Load of body i on body j through a joint, at the joint's point, including the drive between them."""

    force_world: np.ndarray  # (3,) [N]
    torque_world: np.ndarray  # (3,) [N m]
    axial_torque: float  # along the axis of body j [N m]: the drive's torque, zero in a free hinge


def reactions(system, configuration, velocity, solution: Solution, drive=None) -> dict[str, Reaction]:
    """Return the reaction of every joint by name (theory, eqs. (8.23), (8.24)).

    Multipliers of redundant rows are only the shortest choice; their sum over a joint and its drive is unique.
    """
    configuration, velocity, _, drive = as_float_arrays(system, configuration, velocity, None, drive)
    p = place(configuration, velocity)
    raise_if_singular(system, p.singular)
    e = equations(system.arrays, p, drive)  # twist columns: forces and torques in all coordinates
    n = len(system.bodies)
    out = {}
    for k, joint in enumerate(system.joints):
        part = list(range(5 * k, 5 * k + 5))
        for d, drive_part in enumerate(system.drives):
            if {drive_part.body_i, drive_part.body_j} == {joint.body_i, joint.body_j}:
                part += range(5 * len(system.joints) + 3 * d, 5 * len(system.joints) + 3 * d + 3)
        column = 6 * (joint.body_j % (n + 1))
        wrench = -e.jacobian_t[column : column + 6, part] @ solution.multipliers[part]
        R = p.rotation[joint.body_j].reshape(3, 3)
        force = wrench[:3]
        torque = R @ wrench[3:] - np.cross(R @ np.asarray(joint.point_j, float), force)
        axis = R @ system.arrays.joint_triads[k, 1, 2]
        out[joint.name] = Reaction(force, torque, float(axis @ torque))
    return out
