"""Charge, voltage, current, power and energy of the battery over time."""

import numpy as np

from lapwing.flights.battery_use import battery_use
from lapwing.flights.flight_data import FlightData
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Level, Line, Mark, NotRecordedError, Panel, Plot, column
from lapwing.views.report.style import BOUND, STEERED

ORDER = 55
TITLE = "Battery"
NEEDS = ("ground_truth", "battery")
MODELS = STEERED
IMPORTED = "imported"  # mode of the log of a recorded flight


def draw(flight: FlightData) -> Plot:
    """Plot each quantity in a panel, with the limits of charge and voltage."""
    use = battery_use(flight)
    if use is None:
        return _measured(flight)
    t = use.times
    charge: list[Mark] = [Line(t, 100.0 * use.charge)]
    if use.low_threshold is not None:
        charge.append(Level(100.0 * use.low_threshold, "low-battery warning", BOUND, "dash"))
    voltage: list[Mark] = [Line(t, use.voltage)]
    if use.cutoff is not None:
        voltage.append(Level(use.cutoff, "cut-off", BOUND, "dot"))
    panels = (
        Panel(tuple(charge), "charge [%]"),
        Panel(tuple(voltage), "voltage [V]"),
        Panel((Line(t, use.current),), "current [A]"),
        Panel((Line(t, use.voltage * use.current),), "power [W]"),
        Panel((Line(t, use.energy_drawn),), "energy drawn [W h]"),
    )
    return Plot(caption=f"Battery pack under load. {use}", **column(panels, 1.35, **over(flight)))


def _measured(flight: FlightData) -> Plot:
    """Plot the readings of a battery monitor, for a flight without its charge."""
    view = flight.topic("battery")
    quantities = {"voltage [V]": view.voltage, "current [A]": np.abs(view.current)}
    known = {label: values for label, values in quantities.items() if np.isfinite(values).any()}
    if flight.metadata.get("mode") != IMPORTED or not known:
        raise NotRecordedError("the scene has no battery model; use [effects.battery] or [effects.battery_thevenin]")
    panels = [Panel((Line(view.times, values),), label) for label, values in known.items()]
    return Plot(caption="Readings of the battery monitor.", **column(panels, 1.8, **over(flight)))
