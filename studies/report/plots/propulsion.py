"""Thrust, torque and power of one propeller over its speed (the paper's Figure 27)."""

import numpy as np
from matplotlib.figure import Figure

from studies.flight import Flight
from studies.report.plots.motors import RPM
from studies.report.style import DASHED, FLOWN, STEERED, WIDTH, NotRecordedError

ORDER = 60
TITLE = "Propulsion: thrust, torque and power over speed"
NEEDS = ("truth",)
MODELS = STEERED
_SAMPLES = 20000  # drawn at most


def draw(flight: Flight) -> tuple[Figure, str]:
    """Samples of the first propeller, and the curves k n^2 and k n^3 through them by least squares."""
    speed = _first(flight, "rotor_speed")
    if not (speed.size and np.ptp(speed) > 0.0):
        raise NotRecordedError("the first propeller never changes its speed")
    thrust, torque, power = (_first(flight, name) for name in ("rotor_thrust", "rotor_torque", "motor_power"))
    every = max(1, len(speed) // _SAMPLES)
    curve = np.linspace(0.0, speed.max(), 200)
    figure = Figure(figsize=(WIDTH, 3.4), layout="constrained")
    panels = (
        ("thrust [N]", "through the samples: $k n^2$", thrust, coefficient(speed, thrust, 2) * curve**2),
        ("torque [N m]", "through the samples: $k n^2$", torque, coefficient(speed, torque, 2) * curve**2),
        ("power [W]", "at the shaft: $k n^3$", power, coefficient(speed, torque * speed, 3) * curve**3),
    )
    for axis, (label, law, samples, model) in zip(figure.subplots(1, 3), panels, strict=True):
        name = "recorded, electrical" if samples is power else "recorded"
        axis.plot(speed[::every] * RPM, samples[::every], ".", color=FLOWN, markersize=2.5, alpha=0.5, label=name)
        axis.plot(curve * RPM, model, label=law, zorder=3, **DASHED)
        axis.set(xlabel="propeller speed [rpm]", ylabel=label)
        axis.set_ylim(min(0.0, samples.min()), 1.3 * max(samples.max(), model.max()))
        axis.legend(loc="upper left", fontsize=8.5)
    return figure, (
        f"Propeller 1. Fitted by least squares: thrust {coefficient(speed, thrust, 2):.3e} N s²/rad², "
        f"torque {coefficient(speed, torque, 2):.3e} N m s²/rad². Electrical power lies above that at the shaft by the "
        "motor's losses, and off the curve while the propeller speeds up or slows down."
    )


def coefficient(speed: np.ndarray, value: np.ndarray, power: int) -> float:
    """k of value = k speed^power by least squares."""
    law = speed**power
    return float(law @ value / (law @ law))


def _first(flight: Flight, field: str) -> np.ndarray:
    """The first rotor's values of a field of VehicleState, shape (n,); empty without rotors."""
    return flight.truth[field][:, :1].reshape(-1)
