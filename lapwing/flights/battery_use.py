"""Energy drawn from the battery in a flight, and the remaining energy."""

from typing import NamedTuple

import numpy as np

from lapwing.dynamics.effects.battery_thevenin import NOMINAL_VOLTAGE
from lapwing.flights.flight_data import FlightData

EFFECTS = ("battery", "battery_thevenin")  # effects that model the charge
WATT_HOUR = 3600.0  # [J] display unit of energy
LOW_THRESHOLD = "BAT_LOW_THR"  # parameter: charge below which the autopilot warns, fraction


class BatteryUse(NamedTuple):
    """State of the battery at n times of the flight, and at the landing or, without one, at the end of the log."""

    times: np.ndarray  # [s] shape (n,), like all arrays here
    charge: np.ndarray  # fraction of the capacity
    voltage: np.ndarray  # [V] of the pack under load
    current: np.ndarray  # [A] discharge current
    energy_drawn: np.ndarray  # [W h] since the start
    cutoff: float | None  # [V] pack voltage below which the motors stop
    low_threshold: float | None  # charge below which the autopilot warns, fraction
    landing: float  # [s] time of the landing
    charge_left: float  # fraction of the capacity at the landing
    energy_left: float  # [W h] at nominal voltage, at the landing
    least_voltage: float  # [V] minimum until the landing

    def __str__(self) -> str:
        """Return the margin at the landing as a sentence."""
        volts = "" if self.cutoff is None else f", {self.cutoff:.1f} V at the cut-off"
        return (
            f"At {self.landing:.1f} s, the landing or the end, {100.0 * self.charge_left:.1f} % of the charge is left, "
            f"{self.energy_left:.1f} W h at {NOMINAL_VOLTAGE} V a cell. Drawn: {self.energy_drawn[-1]:.2f} W h. "
            f"Lowest voltage: {self.least_voltage:.1f} V{volts}."
        )


def battery_use(flight: FlightData) -> BatteryUse | None:
    """Return the use of the battery, or None if the log has no charge because no effect models it."""
    if not flight.has("battery"):
        return None
    view = flight.topic("battery")
    charge = np.asarray(view.percentage, float)
    if not len(charge) or not np.isfinite(charge).all():
        return None
    voltage, current = np.asarray(view.voltage, float), np.abs(np.asarray(view.current, float))
    power = voltage * current
    steps = np.diff(view.times) * 0.5 * (power[1:] + power[:-1])
    cells = view["cell_voltage"].shape[1]
    capacity = float(view.design_capacity[-1])  # [A h]
    landing = flight.outcome.time
    last = int(np.searchsorted(view.times, landing, side="right").clip(1, len(view)) - 1)
    drawn, left = np.concatenate([[0.0], np.cumsum(steps)]) / WATT_HOUR, float(charge[last])
    return BatteryUse(
        view.times, charge, voltage, current, drawn, _cutoff(flight, cells), _low_threshold(flight), landing,
        left, left * capacity * cells * NOMINAL_VOLTAGE, float(voltage[: last + 1].min()),
    )  # fmt: skip


def _cutoff(flight: FlightData, cells: int) -> float | None:
    """Return the cut-off voltage [V] of the pack, or None if no effect of the scene has one."""
    effects = flight.origin.scene.get("effects", {})
    battery = next((effects[name] for name in EFFECTS if name in effects), None)
    return None if battery is None else cells * float(battery.get("cutoff_voltage", 3.0))


def _low_threshold(flight: FlightData) -> float | None:
    """Return the charge fraction at which the autopilot warns, or None without such a parameter."""
    try:
        parameters = getattr(flight.config.services["autopilot"].parameters, "parameters", ())
    except (ValueError, KeyError):
        return None
    return next((float(parameter.default) for parameter in parameters if parameter.name == LOW_THRESHOLD), None)
