"""Angular velocity over time, and of a satellite its path in phase space (the source's Figures 4 and 5)."""

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Line, Panel, Plot
from lapwing.views.report.style import AXIS_COLOURS

ORDER = 15
TITLE = "Angular velocity"
NEEDS = ("ground_truth",)
PAIRED = "gyrostat"  # model whose rates are also drawn in pairs


def draw(flight: FlightData) -> Plot:
    """Plot three rates over time, and each pair of them on the right for a satellite."""
    paired = flight.origin.scene.get("vehicle", {}).get("model") == PAIRED
    t, omega = flight.truth.times, flight.truth.angular_velocity
    panels = []
    for row, colour in enumerate(AXIS_COLOURS):
        first, second = row, (row + 1) % 3
        panels.append(Panel((Line(t, omega[:, row], colour=colour, width=0.9),), f"ω{'xyz'[row]} [rad/s]", row=row))
        if not paired:
            continue
        pair = Line(omega[:, first], omega[:, second], width=0.5)
        labels = f"ω{'xyz'[second]} [rad/s]", f"ω{'xyz'[first]} [rad/s]"
        panels.append(Panel((pair,), *labels, row=row, column=1, timed=False))
    largest = np.linalg.norm(omega, axis=1).max()
    pairs = ", and in pairs" if paired else ""
    caption = f"Angular velocity in the body frame over time{pairs}. Largest magnitude: {largest:.3g} rad/s."
    widths = (1.7, 1.0) if paired else (1.0,)
    return Plot(tuple(panels), caption, 7.6 if paired else 6.0, (1.0,) * 3, widths, **over(flight))
