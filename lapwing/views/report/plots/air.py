"""Wind and density of the air over time."""

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Band, Line, Mark, NotRecordedError, Panel, Plot, column
from lapwing.views.report.style import AXIS_COLOURS, STEERED

ORDER = 80
TITLE = "Air: wind and density"
NEEDS = ("ground_truth",)
MODELS = STEERED
AVERAGE = 1.0  # [s] averaging time of the wind, to smooth the turbulence


def draw(flight: FlightData) -> Plot:
    """Plot world-frame wind and density, as far as recorded."""
    t, wind, density = flight.truth.times, flight.truth.wind, flight.truth.air_density
    if not (wind.any() or density.any()):
        raise NotRecordedError("neither wind nor air density")
    panels = []
    if wind.any():
        panels.append(Panel(_wind(t, wind), "wind [m/s]"))
    if density.any():
        panels.append(Panel((Line(t, density),), "density [kg/m³]"))
    note = f" Wind: mean over {AVERAGE:g} s, and its range within that time (shaded)." if wind.any() else ""
    note = note or " The log has no wind."
    return Plot(
        caption=f"Velocity of the air in the world frame (ENU), and its density, at the vehicle.{note}",
        **column(panels, 1.9, **over(flight)),
    )


def _wind(times: np.ndarray, wind: np.ndarray) -> tuple[Mark, ...]:
    """Return lines of the mean and bands of the range over each AVERAGE of the wind [m/s], shape (n, 3)."""
    interval = np.floor((times - times[0]) / AVERAGE).astype(int)
    starts = np.flatnonzero(np.diff(interval, prepend=-1))
    counts = np.diff(np.append(starts, len(times)))
    middle = np.add.reduceat(times, starts) / counts
    low, high = np.minimum.reduceat(wind, starts), np.maximum.reduceat(wind, starts)
    mean = np.add.reduceat(wind, starts) / counts[:, None]
    bands = [Band(middle, low[:, k], high[:, k], "", AXIS_COLOURS[k]) for k in range(3)]
    return (*bands, *(Line(middle, mean[:, k], name, AXIS_COLOURS[k]) for k, name in enumerate("xyz")))
