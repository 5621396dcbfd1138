"""Consistent initial states: correction of a state, or an error that names the violated rows."""

import numpy as np

from lapwing.dynamics.multibody.augmented import ANY, as_float_arrays, refuse_singular
from lapwing.dynamics.multibody.constraints import velocity_defect
from lapwing.dynamics.multibody.stabilisation import project, rows

CONSISTENT = 1e-9  # [m, -, m/s, rad/s] largest defect of a consistent state
NEAR = 0.2  # largest position defect that is corrected: beyond it, another assembly of the mechanism may be found


def check(system, configuration, velocity, drive=None, tolerance=CONSISTENT) -> None:
    """Raise ValueError with every violated row and its defect if a state does not satisfy its constraints."""
    configuration, velocity, _, drive = as_float_arrays(system, configuration, velocity, None, drive)
    p, e = rows(system.arrays, configuration, velocity, drive)
    refuse_singular(system, p.singular)
    names, holonomic = system.row_names(), len(e.residual)
    bad = [f"{names[r]} (position, {e.residual[r]:.3g})" for r in np.flatnonzero(np.abs(e.residual) > tolerance)]
    slip = velocity_defect(e, velocity)
    bad += [f"{names[r]} (velocity, {slip[r]:.3g})" for r in np.flatnonzero(np.abs(slip) > tolerance)]
    if bad:
        raise ValueError(f"initial state violates {len(bad)} of {holonomic + len(slip)} conditions: {'; '.join(bad)}")


def consistent(system, configuration, velocity, drive=None):
    """Return the nearest consistent (configuration, velocity) in the metric of the masses.

    Raises:
        ValueError: a joint is apart by more than `NEAR`, or no state satisfies all rows; names the violated rows.
    """
    configuration, velocity, _, drive = as_float_arrays(system, configuration, velocity, None, drive)
    p, e = rows(system.arrays, configuration, velocity, drive)
    refuse_singular(system, p.singular)
    if len(e.residual) and np.max(np.abs(e.residual)) > NEAR:
        check(system, configuration, velocity, drive, NEAR)
    configuration, velocity = project(system.arrays, configuration, velocity, drive, (ANY, ANY))
    check(system, configuration, velocity, drive)
    return configuration, velocity
