"""Points where the rays of scanning lidars and depth cameras met a surface, of the latest scan at each time."""

from collections.abc import Callable, Iterator
from itertools import chain, pairwise
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.messages.topic_columns import history
from lapwing.messages.topics import DEPTH_IMAGE, LASER_SCAN, POINT_CLOUD, Topic
from lapwing.services.sensors.depth_camera import pixels
from lapwing.services.sensors.lidar import azimuths
from lapwing.services.sensors.registry import parameters
from lapwing.studies.flight_data import FlightData
from lapwing.studies.view3d.sampling import nearest, rotate

BUDGET = 150_000  # points of all scans of an instrument in a recording, 6 bytes each
MOST, FEWEST = 2500, 64  # points of one scan
PERIOD = 0.2  # [s] between the scans of a long recording
SIZE = 0.035  # [m] of a drawn point


class Scans(NamedTuple):
    """Scans of one instrument."""

    name: str
    latest: np.ndarray  # (k,) rows of the scans at the k times; -1 before the first
    times: np.ndarray  # (m,) [s]
    origins: np.ndarray  # (m, 3) [m] world position of the vehicle
    points: list[np.ndarray]  # of each scan (n, 3) [m] from its origin, in axes of the world


def scans(flight: FlightData, times: np.ndarray, budget: int = BUDGET) -> list[Scans]:
    """Return the scans of a flight that are the latest at `times` [s], shape (k,), rising, thinned to few points.

    A recorded flight that was read without these topics takes them from its log, image by image.

    Args:
        flight: the flight.
        times: of frames.
        budget: points of all scans of an instrument; at least `FEWEST` of each scan are kept.

    Raises:
        ValueError: the log cannot be read.
    """
    result, tables = [], flight.origin.scene.get("sensors", {})
    for name, topics in INSTRUMENTS.items():
        try:
            p = parameters(name, tables[name], 1.0) if name in tables else None
        except ConfigError:  # of a log of another version
            p = None
        if p is None:
            continue
        period = max(1.0 / p.rate, PERIOD if len(times) > budget // MOST else 0.0)
        most = int(np.clip(budget // min(len(times), round(np.ptp(times) / period) + 1), FEWEST, MOST))
        for topic, in_body in topics.items():
            known = _select(_messages(flight, topic), times, period)
            at = [(time, in_body(p, history(topic.message, [payload]))) for time, payload in known]
            if at:
                result.append(_in_world(name, flight, times, at, most))
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
    """Yield the messages that are the latest at one of `times`, at least `period` [s] apart."""
    last = -np.inf
    for (time, payload), (after, _) in pairwise(chain(messages, [(np.inf, b"")])):
        first, stop = np.searchsorted(times, (time - 1e-9, after - 1e-9))
        if stop > first and time >= last + period - 1e-6:
            yield time, payload
            last = time


def _in_world(name: str, flight: FlightData, times: np.ndarray, at: list[tuple[float, np.ndarray]], most: int) -> Scans:
    """Turn the points of scans, by time [s], into axes of the world; keep at most `most` of each."""
    known = np.array([time for time, _ in at])
    rows = nearest(flight.truth.times, known)
    points = []
    for row, (_, body) in zip(rows, at, strict=True):
        hits = body[np.isfinite(body).all(axis=1)]
        if len(hits) > most:
            hits = hits[np.linspace(0, len(hits) - 1, most).astype(int)]
        points.append(rotate(flight.truth.orientation[row][[3, 0, 1, 2]], hits).astype(np.float32))
    latest = np.searchsorted(known, times + 1e-9, side="right") - 1
    return Scans(name, latest, known, flight.truth.position[rows], points)


def _of_laser_scan(p: Any, columns: Any) -> np.ndarray:
    ranges, elevation = columns["ranges"][0].astype(float), np.radians(p.elevation_min_deg)
    angle, level = azimuths(p), np.cos(elevation)
    away = np.column_stack([level * np.cos(angle), level * np.sin(angle), np.full(len(angle), np.sin(elevation))])
    return _along(away, ranges, p.position)


def _of_cloud(p: Any, columns: Any) -> np.ndarray:
    return np.ascontiguousarray(columns["data"][0]).view("<f4").reshape(-1, 3).astype(float)


def _of_depth(p: Any, columns: Any) -> np.ndarray:
    away, cosines = pixels(p)
    depth = np.ascontiguousarray(columns["data"][0]).view("<f4").astype(float)
    return _along(away, depth / cosines, p.position)


def _along(away: np.ndarray, distance: np.ndarray, origin: Any) -> np.ndarray:
    """Return points along rays (n, 3), body; not finite where nothing was met."""
    met = np.where(np.isfinite(distance), distance, np.nan)
    return away * met[:, None] + np.asarray(origin, float)


INSTRUMENTS: dict[str, dict[Topic, Callable[[Any, Any], np.ndarray]]] = {
    "lidar": {LASER_SCAN: _of_laser_scan, POINT_CLOUD: _of_cloud},
    "depth_camera": {DEPTH_IMAGE: _of_depth},
}


class ScanPoints:
    """Node with the points of the latest scan of one instrument."""

    def __init__(self, scene: Any, colour: tuple[int, int, int], name: str):
        """Add the node, hidden."""
        self._cloud = scene.add_point_cloud(
            name,
            np.zeros((1, 3), np.float32),
            colour,
            point_size=SIZE,
            point_shape="circle",
            point_shading="flat",
            visible=False,
        )
        self._time, self._shown = -np.inf, False

    def show(self, scans: Scans, k: int) -> None:
        """Show the scan that is the latest at the k-th time; hide the points if it met nothing."""
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
