"""Speed, voltage and power of each motor over time (the paper's Figures 24 to 26)."""

import numpy as np
from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.style import FLOWN, STEERED, NotRecordedError, line, rows, shade_phases

ORDER = 50
TITLE = "Motors: speed, voltage and power"
NEEDS = ("truth",)
MODELS = STEERED
RPM = 60.0 / (2.0 * np.pi)  # of 1 rad/s


def draw(flight: Flight) -> tuple[Figure, str]:
    """One row for each quantity, one column for each motor."""
    t = flight.truth.times
    quantities = (
        ("propeller speed [rpm]", flight.truth.rotor_speed * RPM),
        ("voltage [V]", flight.truth.motor_voltage),
        ("electrical power [W]", flight.truth.motor_power),
    )
    count = quantities[0][1].shape[-1]
    if count == 0:
        raise NotRecordedError("the vehicle has no motors")
    figure, axes = rows(3, columns=count, sharey="row")
    for row, (label, values) in zip(axes, quantities, strict=True):
        row[0].set_ylabel(label)
        for axis, of_motor in zip(row, values.T, strict=True):
            line(axis, t, of_motor, color=FLOWN, linewidth=0.9)
    for motor, axis in enumerate(axes[0]):
        axis.set_title(f"motor {motor + 1}")
    shade_phases(axes, flight)
    energy = float(np.sum(np.diff(t) * quantities[2][1].sum(axis=1)[:-1])) / 3600.0
    return (
        figure,
        f"Speed of each propeller, voltage and electrical power of its motor. Energy drawn: {energy:.1f} W h.",
    )
