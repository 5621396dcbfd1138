"""Angular velocity of a satellite over time, and its path in phase space (the source's Figures 4 and 5)."""

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.flight_phases import over
from lapwing.studies.report.plot import Line, Panel, Plot
from lapwing.studies.report.style import AXIS_COLOURS

ORDER = 15
TITLE = "Angular velocity"
NEEDS = ("ground_truth",)
MODELS = ("gyrostat",)


def draw(flight: FlightData) -> Plot:
    """Plot three rates over time on the left, each pair of them on the right."""
    t, omega = flight.truth.times, flight.truth.angular_velocity
    panels = []
    for row, colour in enumerate(AXIS_COLOURS):
        first, second = row, (row + 1) % 3
        panels.append(Panel((Line(t, omega[:, row], colour=colour, width=0.9),), f"ω{'xyz'[row]} [rad/s]", row=row))
        pair = Line(omega[:, first], omega[:, second], width=0.5)
        labels = f"ω{'xyz'[second]} [rad/s]", f"ω{'xyz'[first]} [rad/s]"
        panels.append(Panel((pair,), *labels, row=row, column=1, timed=False))
    largest = np.linalg.norm(omega, axis=1).max()
    caption = f"Angular velocity in the body frame over time, and in pairs. Largest magnitude: {largest:.3g} rad/s."
    return Plot(tuple(panels), caption, 7.6, (1.0,) * 3, (1.7, 1.0), **over(flight))
