"""Recording of flights as one page of viser's player, which works offline."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.views.report.style import COLOURS
from lapwing.views.view3d import require
from lapwing.views.view3d.local_server import run_server
from lapwing.views.view3d.samples import Samples, sample
from lapwing.views.view3d.sampling import thin_path
from lapwing.views.view3d.scans import BUDGET
from lapwing.views.view3d.stage import Vehicle, reach, vehicle_colours
from lapwing.views.view3d.surroundings import add_surroundings

RATE = 30.0  # [1/s] frame rate of a recording
FRAMES = 2000  # largest number of frames of a recording; the rate of a longer one is lower
FLEET_FRAMES = 24000  # largest number of frames times vehicles
SCRIPTS = ("software.js", "bridge.js", "toolbar.js", "sticks.js")
POINTS = 1500  # largest number of points of a trail, before those are removed that it can be drawn without
PLACE, TINT = 0.02, 0.05  # errors of a trail's place and colour, over the size of the vehicle and the colour scale


def page(flights: Sequence[FlightData], names: Sequence[str], times: np.ndarray | None = None) -> str:
    """Return the page of a flight with its fleet, or of a comparison of flights.

    Args:
        flights: one flight, or several to compare; all but the first are translucent.
        names: display names of the flights.
        times: times of the frames [s], shape (k,), ascending; None: `RATE` frames per second of the entire flights.

    Raises:
        ValueError: viser is not installed, or a flight has no position.
    """
    require()
    for flight in flights:
        if not flight.located:
            raise ValueError(f"{flight.origin.source}: the position is not measured, no 3D view; use lapwing report")
    compared = len(flights) > 1
    shown = list(flights) if compared else [flights[0], *flights[0].others]
    titles = list(names) if compared else [flight.vehicle for flight in shown]
    if compared or len(shown) == 1:
        colours = list(vehicle_colours(len(shown), compared))
    else:
        order = list(flights[0].fleet)
        colours = [COLOURS[order.index(name) % len(COLOURS)] for name in titles]
    if times is None:
        times = _frame_times(shown)
    with run_server() as server, server.atomic():  # sends nothing: no client is connected
        add_surroundings(server.scene, shown[0])
        vehicles = [
            Vehicle(server.scene, k, flight, title, colour, ghost=compared and k > 0, named=len(shown) > 1)
            for k, (flight, title, colour) in enumerate(zip(shown, titles, colours, strict=True))
        ]
        recording, most, trails = _record(server, shown, vehicles, times)
        html: str = recording.as_html()
    facts = {
        "names": titles,
        "colours": colours,
        "size": max(reach(vehicle.motion) for vehicle in vehicles),
        "start": float(times[0]),
        "error": most,
        "trails": trails,
        "step": float(times[1] - times[0]),
        "live": False,
    }
    return with_bridge(html, facts)


def _frame_times(shown: Sequence[FlightData]) -> np.ndarray:
    """Return times [s] from the first to the last of all flights."""
    start = min(float(flight.truth.times[0]) for flight in shown)
    stop = max(float(flight.truth.times[-1]) for flight in shown)
    count = min(FRAMES, FLEET_FRAMES // len(shown), max(2, round((stop - start) * RATE) + 1))
    return np.linspace(start, stop, count)


def _record(server: Any, shown: Sequence[FlightData], vehicles: Sequence[Vehicle], times: np.ndarray) -> Any:
    """Record all frames; return the recording, the error [m] at the end of the colour scale, and the trails' times [s].

    A trail is one line, one draw call, of which the page shows the part up to the current time. The times are those of
    its points.
    """
    all_times = _frame_times(shown)
    trail_times = np.linspace(all_times[0], all_times[-1], min(POINTS, len(all_times)))
    paths = [sample(flight, vehicle.motion, trail_times) for flight, vehicle in zip(shown, vehicles, strict=True)]
    errors = [path.error for path in paths if path.error is not None]
    most = float(max(np.quantile(error, 0.995) for error in errors)) if errors else 0.0
    trails = []
    for vehicle, path in zip(vehicles, paths, strict=True):
        if path.desired is not None:
            vehicle.desired_path(path.desired)
        keep = _trail_points(vehicle, path, most)
        error = None if path.error is None else path.error[keep]
        vehicle.trail(path.bodies[0].position[keep], error, most)
        trails.append(np.round(trail_times[keep], 3).tolist())
    points = BUDGET // len(shown)
    samples = [sample(flight, vehicle.motion, times, points) for flight, vehicle in zip(shown, vehicles, strict=True)]
    for vehicle, result in zip(vehicles, samples, strict=True):
        vehicle.show(result, 0)
    clock = server.scene.add_frame("/clock", show_axes=False)  # its x is the time since the start [s]
    recording = server.get_scene_serializer()
    for k in range(len(times)):
        clock.position = (float(times[k] - times[0]), 0.0, 0.0)
        for vehicle, result in zip(vehicles, samples, strict=True):
            vehicle.show(result, k)
        if k + 1 < len(times):
            recording.insert_sleep(float(times[k + 1] - times[k]))
    return recording, most, trails


def _trail_points(vehicle: Vehicle, path: Samples, most: float) -> np.ndarray:
    """Return the indices of the points with which the line has the place and colour of the complete path."""
    columns, tolerance = path.bodies[0].position, PLACE * reach(vehicle.motion)
    if path.error is not None and most > 0.0:
        columns = np.column_stack([columns, np.nan_to_num(path.error) * tolerance / (TINT * most)])
    return thin_path(columns, tolerance)


def with_bridge(html: str, facts: dict[str, Any]) -> str:
    """Return a page of viser's client with the camera and time controls of this project.

    Args:
        html: page of viser's client.
        facts: "names" and "colours" of the vehicles, "size" of the largest [m], "start" [s], largest "error" [m],
            "live", and of a live view "sticks", the vehicles that accept commands; for a recording "trails", the times
            of the points of each trail [s], and "step", the time between two frames [s].
    """
    code = "".join((Path(__file__).parent / name).read_text(encoding="utf-8") for name in SCRIPTS)
    text = json.dumps(facts, separators=(",", ":")).replace("<", "\\u003c")
    return html.replace("<head>", f"<head><script>window.lapwing={text};{code}</script>", 1)
