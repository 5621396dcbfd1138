"""Thrust, torque and power of one propeller over its speed (the paper's Figure 27)."""

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.plot import Line, NotRecordedError, Panel, Plot, reference, subsample
from lapwing.views.report.plots.motors import RPM
from lapwing.views.report.style import STEERED

ORDER = 60
TITLE = "Propulsion: thrust, torque and power over speed"
NEEDS = ("ground_truth",)
MODELS = STEERED


def draw(flight: FlightData) -> Plot:
    """Plot samples of the first propeller, and least-squares curves k n^2 and k n^3."""
    speed = _first(flight, "rotor_speed")
    if not (speed.size and np.ptp(speed) > 0.0):
        raise NotRecordedError("the speed of the first propeller is constant")
    thrust, torque, power = (_first(flight, name) for name in ("rotor_thrust", "rotor_torque", "motor_power"))
    curve = np.linspace(0.0, speed.max(), 200)
    square, cube = "fit k n²", "fit k n³ of the shaft power"
    panels: list[Panel] = []
    for name, law, samples, model in (
        ("thrust [N]", square, thrust, coefficient(speed, thrust, 2) * curve**2),
        ("torque [N m]", square, torque, coefficient(speed, torque, 2) * curve**2),
        ("electrical power [W]", cube, power, coefficient(speed, torque * speed, 3) * curve**3),
    ):
        dots = Line(subsample(speed) * RPM, subsample(samples), "recorded", marker="circle", size=2.5, joined=False)
        marks = dots, reference(curve * RPM, model, name=law)
        panels.append(Panel(marks, name, "propeller speed [rpm]", column=len(panels), timed=False))
    return Plot(
        tuple(panels),
        f"Propeller 1. Fitted by least squares: thrust {coefficient(speed, thrust, 2):.3e} N s²/rad², "
        f"torque {coefficient(speed, torque, 2):.3e} N m s²/rad². Electrical power exceeds shaft power by the "
        "motor's losses, and deviates from the curve while the propeller accelerates.",
        3.4,
        widths=(1.0,) * 3,
    )


def coefficient(speed: np.ndarray, value: np.ndarray, power: int) -> float:
    """Return k of value = k speed^power by least squares; speed [rad/s] and value have shape (n,)."""
    law = speed**power
    return float(np.sum(law * value) / np.sum(law * law))  # without BLAS, which would start its threads


def _first(flight: FlightData, field: str) -> np.ndarray:
    """Return the first rotor's values of a field of VehicleState, shape (n,); empty without rotors."""
    return flight.truth[field][:, :1].reshape(-1)
