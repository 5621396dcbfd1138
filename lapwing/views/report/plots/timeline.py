"""Autopilot timeline: phases, modes, arming, failsafes."""

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_events import BATTERY
from lapwing.flights.saturation import highest_voltage, saturation, spans
from lapwing.views.report.flight_phases import over, phases, runs
from lapwing.views.report.plot import Panel, Plot, Stretch
from lapwing.views.report.style import AXIS_COLOURS, BOUND, COLOURS, FLOWN, QUIET

ORDER = 0
TITLE = "Timeline"
NEEDS = ("ground_truth", "status")
MARKED = {"fault": BOUND, "contact": QUIET}  # kinds of events shown as instants
WIDTH = 0.004  # width of an instant, relative to the time span


def draw(flight: FlightData) -> Plot:
    """Plot a lane for each state or event; empty lanes are only named."""
    status, t = flight.status, flight.status.times
    warning = np.array(BATTERY)[status.battery_warning.clip(max=len(BATTERY) - 1)]
    failed = np.where(status.failed_motor > 0, np.char.add("motor ", status.failed_motor.astype(str)), "")
    lanes = {
        "phase": (phases(flight), FLOWN),
        "mode": (runs(t, status.mode), AXIS_COLOURS[2]),
        "armed": (runs(t, _label_where(status.armed, "armed")), AXIS_COLOURS[1]),
        "landed": (runs(t, _label_where(status.landed, "landed")), QUIET),
        "failsafe": (runs(t, _label_where(status.failsafe, "failsafe")), BOUND),
        "motor failed": (runs(t, failed), BOUND),
        "battery": (runs(t, warning), BOUND),
        "status text": (runs(t, status.text), COLOURS[3]),
        "motor limit": (_saturated(flight), COLOURS[4]),
        **{kind: (_instants(flight, kind), colour) for kind, colour in MARKED.items()},
    }
    all_lanes = {lane: ([run for run in intervals if run[0]], colour) for lane, (intervals, colour) in lanes.items()}
    bars = tuple(
        Stretch(lane, s, e, text, colour) for lane, (entries, colour) in all_lanes.items() for text, s, e in entries
    )
    empty = [lane for lane, (entries, _) in all_lanes.items() if not entries]
    note = f" None in this flight: {', '.join(empty)}." if empty else ""
    shown = max(len(all_lanes) - len(empty), 1)
    return Plot(
        (Panel(bars),),
        f"State of the autopilot ({len(t)} messages) and events.{note}",
        1.1 + 0.32 * shown,
        span=over(flight)["span"],
    )


def _label_where(flags: np.ndarray, text: str) -> np.ndarray:
    return np.where(flags, text, "")


def _saturated(flight: FlightData) -> list[tuple[str, float, float]]:
    """Return the intervals with a motor at a voltage limit, wide enough to be visible."""
    highest = highest_voltage(flight.origin.scene)
    if highest is None or not len(flight.armed):
        return []
    first, last = over(flight)["span"]
    least = WIDTH * (last - first)
    listed = spans(saturation(flight.truth, flight.armed, highest), flight.truth.times, highest)
    return [(text, start, min(last, max(end, start + least))) for text, start, end in listed]


def _instants(flight: FlightData, kind: str) -> list[tuple[str, float, float]]:
    """Return events of a kind as intervals (text, start, end) that are just wide enough to be visible."""
    first, last = over(flight)["span"]
    return [(e.text, e.time, min(last, e.time + WIDTH * (last - first))) for e in flight.events if e.kind == kind]
