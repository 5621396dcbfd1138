"""Quadrotors that carry a load on links."""

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.motion_3d import Link, Motion, Rotor, Stroke, of_bodies
from lapwing.studies.report.shapes._outlines import box
from lapwing.studies.report.style import BOUND

MODELS = ("cooperative_load",)
ARM, LOAD = 0.2, 0.12  # [m] the scene has masses only


def draw(flight: FlightData) -> Motion | None:
    """The load as a box, the quadrotors as crosses, a line for each link."""
    if not flight.has("body_states"):
        return None
    count = flight.topic("body_states").position.shape[1] - 1
    hubs = ARM * np.array([(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (1.0, -1.0, 0.0)]) / np.sqrt(2.0)
    cross = tuple(Stroke(np.array([np.zeros(3), hub]), width=5.0) for hub in hubs)
    rotors = tuple(Rotor(hub, 0.6 * ARM) for hub in hubs)
    load = (Stroke(box(LOAD, LOAD, LOAD), BOUND),)
    bodies = of_bodies(flight, [(load, ()), *[(cross, rotors)] * count])
    return Motion(bodies, tuple(Link(0, 1 + k) for k in range(count)))
