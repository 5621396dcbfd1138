"""Energy of a general multibody system."""

import numpy as np

from lapwing.dynamics.multibody.body_kinematics import place
from lapwing.kernels import kernel


@kernel
def _energy(a, q, v):
    p = place(q, v)
    kinetic, potential = 0.0, 0.0
    for b in range(len(a.mass)):
        kinetic += 0.5 * a.mass[b] * np.sum(p.velocity[b] ** 2)
        for i in range(3):
            for j in range(3):
                kinetic += 0.5 * p.omega[b, i] * a.inertia[b, i, j] * p.omega[b, j]
        potential -= a.mass[b] * np.sum(a.gravity * p.position[b])
    return kinetic, potential


def energy(system, configuration, velocity) -> tuple[float, float]:
    """Return (kinetic, potential) energy [J]; the potential is zero with all centres of mass at the origin."""
    return _energy(system.arrays, np.asarray(configuration, float), np.asarray(velocity, float))
