"""Point clouds of lidars and depth cameras: the latest scan at each time."""

from collections.abc import Callable, Iterator
from itertools import chain, pairwise
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.flights.flight_data import FlightData
from lapwing.flights.rotation_arrays import from_xyzw, rotate
from lapwing.messages.topic_columns import history
from lapwing.messages.topics import DEPTH_IMAGE, LASER_SCAN, POINT_CLOUD, Topic
from lapwing.services.sensors.depth_camera import pixels
from lapwing.services.sensors.lidar import azimuths
from lapwing.services.sensors.schema import parameters
from lapwing.views.view3d.sampling import nearest

BUDGET = 150_000  # largest total number of points of an instrument in a recording, 6 bytes each
MOST, FEWEST = 2500, 64  # limits of the number of points per scan
PERIOD = 0.2  # [s] minimum time between the scans of a long recording
SIZE = 0.035  # [m] size of a drawn point


class Scans(NamedTuple):
    """Scans of one instrument."""

    name: str
    latest: np.ndarray  # (k,) index of the latest scan at each of k times; -1 before the first
    times: np.ndarray  # (m,) [s]
    origins: np.ndarray  # (m, 3) [m] world position of the vehicle
    points: list[np.ndarray]  # points of each scan (n, 3) [m] relative to its origin, world axes


def scans(flight: FlightData, times: np.ndarray, budget: int = BUDGET) -> list[Scans]:
    """Return the latest scans of a flight at `times`, with reduced numbers of points.

    Topics missing in a recorded flight are read from its log, message by message.

    Args:
        flight: the flight.
        times: times of the frames [s], shape (k,), ascending.
        budget: largest total number of points of an instrument; each scan has at least `FEWEST`.

    Raises:
        ValueError: the log cannot be read.
    """
    result, tables = [], flight.origin.scene.get("sensors", {})
    for name, topics in INSTRUMENTS.items():
        try:
            p = parameters(name, tables[name], 1.0) if name in tables else None
        except ConfigError:  # the log is of another version
            p = None
        if p is None:
            continue
        period = max(1.0 / p.rate, PERIOD if len(times) > budget // MOST else 0.0)
        most = int(np.clip(budget // min(len(times), round(np.ptp(times) / period) + 1), FEWEST, MOST))
        for topic, in_body in topics.items():
            selected = _select(_messages(flight, topic), times, period)
            clouds = [(time, in_body(p, history(topic.message, [payload]))) for time, payload in selected]
            if clouds:
                result.append(_in_world(name, flight, times, clouds, most))
    return result


def _messages(flight: FlightData, topic: Topic) -> Iterator[tuple[float, bytes]]:
    """Yield time [s] and CDR of each message."""
    name = topic.name.removeprefix("{vehicle}/")
    if flight.has(name):
        yield from ((1e-9 * time_ns, payload) for time_ns, payload in flight.topic(name).payloads())
    elif flight.origin.recorded:
        with LogReader(flight.origin.source) as log:
            key = topic.key(flight.vehicle)
            if key in log.topics():
                log.check_versions([key])
                yield from ((1e-9 * time_ns, payload) for _, _, time_ns, payload in log.messages([key]))


def _select(messages: Iterator[tuple[float, bytes]], times: np.ndarray, period: float) -> Iterator[tuple[float, bytes]]:
    """Yield the messages that are the latest at one of `times` [s], at least `period` [s] apart."""
    last = -np.inf
    for (time, payload), (after, _) in pairwise(chain(messages, [(np.inf, b"")])):
        first, stop = np.searchsorted(times, (time - 1e-9, after - 1e-9))
        if stop > first and time >= last + period - 1e-6:
            yield time, payload
            last = time


def _in_world(
    name: str, flight: FlightData, times: np.ndarray, clouds: list[tuple[float, np.ndarray]], most: int
) -> Scans:
    """Return scans from point clouds (time [s], points in the body frame [m]), with at most `most` points of each."""
    scan_times = np.array([time for time, _ in clouds])
    rows = nearest(flight.truth.times, scan_times)
    points = []
    for row, (_, body) in zip(rows, clouds, strict=True):
        hits = body[np.isfinite(body).all(axis=1)]
        if len(hits) > most:
            hits = hits[np.linspace(0, len(hits) - 1, most).astype(int)]
        points.append(rotate(from_xyzw(flight.truth.orientation[row]), hits).astype(np.float32))
    latest = np.searchsorted(scan_times, times + 1e-9, side="right") - 1
    return Scans(name, latest, scan_times, flight.truth.position[rows], points)


def _laser_scan_points(p: Any, columns: Any) -> np.ndarray:
    ranges, elevation = columns["ranges"][0].astype(float), np.radians(p.elevation_min_deg)
    angle, level = azimuths(p), np.cos(elevation)
    rays = np.column_stack([level * np.cos(angle), level * np.sin(angle), np.full(len(angle), np.sin(elevation))])
    return _along(rays, ranges, p.position)


def _cloud_points(p: Any, columns: Any) -> np.ndarray:
    return np.ascontiguousarray(columns["data"][0]).view("<f4").reshape(-1, 3).astype(float)


def _depth_points(p: Any, columns: Any) -> np.ndarray:
    rays, cosines = pixels(p)
    depth = np.ascontiguousarray(columns["data"][0]).view("<f4").astype(float)
    return _along(rays, depth / cosines, p.position)


def _along(rays: np.ndarray, distance: np.ndarray, origin: Any) -> np.ndarray:
    """Return points [m] on rays (n, 3), body frame, at distances [m], shape (n,); non-finite without an echo."""
    length = np.where(np.isfinite(distance), distance, np.nan)
    return rays * length[:, None] + np.asarray(origin, float)


INSTRUMENTS: dict[str, dict[Topic, Callable[[Any, Any], np.ndarray]]] = {
    "lidar": {LASER_SCAN: _laser_scan_points, POINT_CLOUD: _cloud_points},
    "depth_camera": {DEPTH_IMAGE: _depth_points},
}


class ScanPoints:
    """Node for the points of the latest scan of one instrument."""

    def __init__(self, scene: Any, colour: tuple[int, int, int], name: str):
        """Add the node, hidden."""
        looks = {"point_size": SIZE, "point_shape": "circle", "point_shading": "flat", "visible": False}
        self._cloud = scene.add_point_cloud(name, np.zeros((1, 3), np.float32), colour, **looks)
        self._time, self._shown = -np.inf, False

    def show(self, scans: Scans, k: int) -> None:
        """Show the latest scan at the k-th time; hide the points if it has none."""
        row = int(scans.latest[k])
        if row < 0 or scans.times[row] == self._time:
            return
        self._time, points = scans.times[row], scans.points[row]
        if (len(points) > 0) != self._shown:
            self._shown = len(points) > 0
            self._cloud.visible = self._shown
        if self._shown:
            self._cloud.position = tuple(np.round(scans.origins[row], 3).tolist())
            self._cloud.points = points
