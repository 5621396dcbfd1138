"""The path in space, and seen from above."""

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.plot import Line, NotRecordedError, Panel, Plot, reference

ORDER = 40
TITLE = "Path"
NEEDS = ("ground_truth",)


def draw(flight: FlightData) -> Plot:
    """The path in 3D on the left, its plan view on the right."""
    if len(flight.truth) > 1 and not np.ptp(flight.truth.position, axis=0).any():
        raise NotRecordedError("it never leaves its place")
    beside = " beside the reference" if len(flight.reference) else ""
    said = f"The flown path{beside}, in space (left) and from above, north up (right)."
    return Plot((space(flight), plan(flight)), said, 4.9, (1.0,), (1.0, 1.0))


def space(flight: FlightData) -> Panel:
    """The path in space; the three axes have one scale."""
    x, y, z = flight.truth.position.T
    marks = [Line(x, y, "flown", width=2.0, z=z)]
    if len(flight.reference):
        east, north, up = flight.reference.T[:3]
        marks.append(reference(east, north)._replace(z=up))
    return Panel(tuple(marks), "y north [m]", "x east [m]", z_label="z up [m]", timed=False)


def plan(flight: FlightData) -> Panel:
    """Return the path from above."""
    x, y, _ = flight.truth.position.T
    marks = [Line(x, y, "flown", width=2.0)]
    if len(flight.reference):
        marks.append(reference(*flight.reference.T[:2]))
    marks.append(Line(x[:1], y[:1], "start", marker="open", size=8.0, joined=False))
    marks.append(Line(x[-1:], y[-1:], "end", marker="square", size=7.0, joined=False))
    return Panel(tuple(marks), "y north [m]", "x east [m]", column=1, timed=False, equal=True)
