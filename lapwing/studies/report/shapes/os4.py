"""The OS4 quadrotor: two crossed arms, a rotor on each end."""

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.motion_3d import Motion, Rotor, Stroke, of_truth
from lapwing.studies.report.style import COLOURS

MODELS = ("os4",)


def draw(flight: FlightData) -> Motion | None:
    """Rotors ahead, right, behind and left, as the source numbers them; they stand still where no speed is told."""
    arm = flight.origin.scene["os4"]["arm"]
    hubs = arm * np.array([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    strokes = tuple(Stroke(np.array([np.zeros(3), hub]), width=6.0) for hub in hubs)
    ahead = Stroke(np.array([np.zeros(3), hubs[0] / 2.0]), COLOURS[1], 6.0)
    still = np.zeros(len(flight.truth))
    return Motion((of_truth(flight, (*strokes, ahead), tuple(Rotor(hub, 0.6 * arm, still) for hub in hubs)),))
