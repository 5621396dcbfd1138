"""Mechanisms built for the general engine: two of the IFToMM benchmark library, and the delivery drone.

Benchmarks A02, A04: M. Gonzalez, D. Dopico, U. Lugris, J. Cuadrado, A benchmarking system for MBS simulation
software, Multibody System Dynamics 16 (2006) 179; https://www.iftomm-multibody.org/benchmark.
Gravity is -y there, 9.81 m/s^2.
Each function returns (system, configuration (n, 7), velocity (n, 6)), consistent.
"""

import math
from collections.abc import Sequence

import numpy as np

from lapwing.dynamics.multibody.delivery_drone import Drone
from lapwing.dynamics.multibody.system import GROUND, Body, DrivingConstraint, Revolute, System, assemble

GRAVITY = (0.0, -9.81, 0.0)
Z = (0.0, 0.0, 1.0)


def _at(positions):
    configuration = np.zeros((len(positions), 7))
    configuration[:, :3] = positions
    configuration[:, 3] = 1.0
    return configuration


def four_bars(n: int = 2, speed: float = 1.0) -> tuple[System, np.ndarray, np.ndarray]:
    """Return A02: n four-bar windows, 2 n + 1 rods of 1 kg and 1 m, cranks upright, tips at `speed` [m/s] along x.

    Bodies: cranks 0..n, then couplers. Whenever the cranks lie flat, the mechanism has n + 1 degrees of freedom.
    """
    thin = 1e-4  # [kg m^2] moment of a rod about its axis, about which no rod turns
    rod = 1.0 / 12.0
    bodies = [Body(f"crank {k}", 1.0, (thin, rod, rod)) for k in range(n + 1)]
    bodies += [Body(f"coupler {k}", 1.0, (thin, rod, rod)) for k in range(n)]
    positions = [(k, 0.5, 0.0) for k in range(n + 1)] + [(k + 0.5, 1.0, 0.0) for k in range(n)]
    configuration = _at(positions)
    configuration[: n + 1, 3] = configuration[: n + 1, 6] = math.sqrt(0.5)  # cranks point along y
    velocity = np.zeros((2 * n + 1, 6))
    velocity[: n + 1, 0], velocity[: n + 1, 5] = 0.5 * speed, -speed
    velocity[n + 1 :, 0] = speed
    root, tip = (-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)
    joints = [Revolute(f"base {k}", GROUND, k, (float(k), 0.0, 0.0), root, Z, Z) for k in range(n + 1)]
    for k in range(n):
        joints.append(Revolute(f"left {k}", k, n + 1 + k, tip, root, Z, Z))
        joints.append(Revolute(f"right {k}", k + 1, n + 1 + k, tip, tip, Z, Z))
    return assemble(bodies, joints, gravity=GRAVITY), configuration, velocity


def bricard() -> tuple[System, np.ndarray, np.ndarray]:
    """Return A04: five rods of 1 kg and 1 m, 0.1 m square, along the edges of a cube, and six hinges; at rest.

    The number of equations leaves no degree of freedom, but one equation is redundant, so the mechanism moves.
    """
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)], float)
    axes = [(0.0, 1.0, 0.0), Z, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), Z, (1.0, 0.0, 0.0)]
    middles = 0.5 * (corners[:-1] + corners[1:])
    slender, thick = (1.0 + 0.01) / 12.0, 0.01 / 6.0
    bodies = [
        Body(f"rod {k + 1}", 1.0, tuple(np.where(along != 0.0, thick, slender)))
        for k, along in enumerate(np.diff(corners, axis=0))
    ]

    def local(corner, body):
        return tuple(corners[corner] - (middles[body] if body != GROUND else 0.0))

    pairs = [(GROUND, 0), (0, 1), (1, 2), (2, 3), (3, 4), (4, GROUND)]
    joints = [
        Revolute(f"hinge {k + 1}", i, j, local(k, i), local(k, j), axes[k], axes[k]) for k, (i, j) in enumerate(pairs)
    ]
    return assemble(bodies, joints, gravity=GRAVITY), _at(middles), np.zeros((5, 6))


def drone_system(drone: Drone, driven: Sequence[bool] = (True, True, True, True)) -> System:
    """Return the five bodies of a `delivery_drone.Drone` as a general system; body 0 is the chassis.

    It has 30 coordinates, 20 joint rows, and three rows for each propeller that is `driven` at an imposed speed
    (gravity along -z, 9.81 m/s^2).
    """
    origin = (0.0, 0.0, 0.0)
    bodies = [Body("chassis", drone.mass, drone.inertia)]
    bodies += [Body(f"propeller {k + 1}", drone.propeller_mass[k], drone.propeller_inertia[k]) for k in range(4)]
    joints = [Revolute(f"hinge {k + 1}", 0, k + 1, drone.hubs[k], origin, Z, Z) for k in range(4)]
    drives = [DrivingConstraint(f"drive {k + 1}", k + 1, 0, Z) for k in range(4) if driven[k]]
    return assemble(bodies, joints, drives)
