"""Case 7: hinges over an hour of flight, with each stabilisation and without."""

import numpy as np

from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles import multirotor_multibody
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorState
from lapwing.kernels.state_tree import flatten
from lapwing.studies.accuracy.systems.delivery_drone import AIRFRAME, SPEED, ZERO, flight
from lapwing.studies.accuracy.systems.delivery_drone import initial_bodies as drone_bodies
from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row
from lapwing.studies.stability.drone import METHOD, PAPER, STABILISATIONS, delivery_drone, hinge_defects, spinning_state

HARD = "an hour of five bodies with 20 constraints: the index-1 equations enforce only their second derivative"

OMEGA, SPEEDS = (0.3, 0.2, 0.5), (20.0, -20.0, 20.0, -20.0)
STEP, STEPS_PER_SAMPLE = 6e-3, 10_000  # [s]; steps between two samples, a minute
MINUTES = 60
BOUND = 1e-10
WHY = "a thousand round-off errors of a coordinate of 1 m: the defect after stabilisation must not grow with time"


def plant_hinge_error(stabilisation: str, seconds: float) -> float:
    """Return the hinge error of five tumbling bodies [m, rad] after a time [s] under RK4 at 2 ms."""
    frame = load_airframe(AIRFRAME)
    volts = (SPEED * frame.motor.rotor_constant,) * 4
    p = multirotor_multibody.parameters(frame, (), "speed", stabilisation)
    out = np.empty((2, len(flatten(Motion(ZERO, NO_ROTATION, ZERO, ZERO, (0.0,) * 4)))))
    state = MultirotorState(drone_bodies(p, frame), ())
    return float(flight(METHOD, p, state, volts, 2e-3, round(seconds / 2e-3), out))


def run() -> CaseResult:
    """Measure the hinge defects after every minute of an hour."""
    p, x = spinning_state(delivery_drone(**PAPER), OMEGA, SPEEDS)
    drift = {
        name: hinge_defects(p, x, stabilisation, STEP, STEPS_PER_SAMPLE, MINUTES)
        for name, stabilisation in STABILISATIONS.items()
    }
    rows = [
        Row(name, f"{name}, RK4 at 6 ms", "largest defect of any hinge in an hour [m, rad, m/s, rad/s]", BOUND, WHY,
            float(drift[name].max()), "no stabilisation", float(np.nanmax(drift["none"])))
        for name in ("projection", "partitioning")
    ]  # fmt: skip
    rows.append(
        Row("baumgarte", "Baumgarte stabilisation at 50/s, RK4 at 2 ms", "hinge error [m, rad] after an hour",
            2.0 * plant_hinge_error("baumgarte", 60.0),
            "twice the error after a minute: feedback leaves the method's error, which must not grow",
            plant_hinge_error("baumgarte", 3600.0), "no stabilisation", plant_hinge_error("none", 3600.0))
    )  # fmt: skip
    t = np.arange(1, MINUTES + 1)
    curves = [Curve(name, t, np.maximum(values, 1e-17)) for name, values in drift.items()]
    return CaseResult(rows, Plot("time [min]", "largest defect", curves, BOUND))
