"""Logs in the folder of recordings: summary, picture and report of each."""

import re
import threading
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from stat import S_ISREG
from typing import Any, NamedTuple

import numpy as np

from lapwing.api.flight import Flight
from lapwing.cosim.output_lock import is_locked, modification_time
from lapwing.flights.flight_data import SHOWN
from lapwing.flights.metrics import own_criteria
from lapwing.flights.outcome import MARKS
from lapwing.views.report import write
from lapwing.views.report.key_numbers import TROUBLE, KeyNumber, key_numbers
from lapwing.views.report.style import COLOURS, FLOWN

WIDTH, HEIGHT, MARGIN = 240.0, 150.0, 14.0  # [pixel]
POINTS = 160  # largest number of points of a path
SMALLEST = 0.5  # [m] minimum extent of the view, so that a hover does not show noise
AZIMUTH, ELEVATION = np.radians(35.0), np.radians(28.0)  # [rad] direction of the viewer
DATED = re.compile(r"_(\d{4}-\d\d-\d\d)T(\d\d)-(\d\d)-(\d\d)")  # in the name of a log

Point = tuple[float, float]
Stroke = tuple[float, float, float, float]  # x and y of both ends


class PathLine(NamedTuple):
    """A path as points of an SVG polyline."""

    colour: str
    air: str
    ground: str
    drops: tuple[Stroke, ...]  # lines from the path to its shadow
    start: Point
    end: Point


class Picture(NamedTuple):
    """All paths of a flight, and a grid on the ground."""

    width: float
    height: float
    paths: tuple[PathLine, ...]
    grid: tuple[Stroke, ...]


def picture(positions: Sequence[np.ndarray]) -> Picture:
    """Return the picture of paths [m], world, each of shape (n, 3)."""
    shown = [path[np.unique(np.linspace(0, len(path) - 1, POINTS).round().astype(int))] for path in positions]
    points = np.concatenate(shown)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        points = np.zeros((1, 3))
    low, high = points.min(axis=0), points.max(axis=0)
    floor = min(0.0, float(low[2])) if low[2] < SMALLEST else float(low[2])
    centre = 0.5 * (low + high)
    half = 0.5 * max(float((high - low)[:2].max()), 0.6 * float(high[2] - floor), SMALLEST) * 1.15
    corners = np.array([(centre[0] + a * half, centre[1] + b * half, floor) for a in (-1, 1) for b in (-1, 1)])
    flat = _project(np.concatenate([points, corners]))
    least, most = flat.min(axis=0), flat.max(axis=0)
    scale = float(min((WIDTH - 2 * MARGIN) / (most[0] - least[0]), (HEIGHT - 2 * MARGIN) / (most[1] - least[1])))
    shift = np.array([0.5 * WIDTH, 0.5 * HEIGHT]) - scale * 0.5 * (least + most)

    def to_pixels(positions: np.ndarray) -> np.ndarray:
        return np.round(scale * _project(positions) + shift, 1)

    lines = []
    for k, path in enumerate(shown):
        path = path[np.isfinite(path).all(axis=1)]
        if not len(path):
            continue
        air, ground = to_pixels(path), to_pixels(np.column_stack([path[:, :2], np.full(len(path), floor)]))
        rows = np.linspace(0, len(path) - 1, 12).round().astype(int)
        drops = tuple(_stroke(air[row], ground[row]) for row in rows)
        colour = COLOURS[k % len(COLOURS)] if len(shown) > 1 else FLOWN
        whole = _stroke(air[0], air[-1])
        lines.append(PathLine(colour, _text(air), _text(ground), drops, whole[:2], whole[2:]))
    grid = []
    for share in np.linspace(-1.0, 1.0, 6):
        for line in (((share, -1.0), (share, 1.0)), ((-1.0, share), (1.0, share))):
            ends = to_pixels(np.array([(centre[0] + half * a, centre[1] + half * b, floor) for a, b in line]))
            grid.append(_stroke(ends[0], ends[1]))
    return Picture(WIDTH, HEIGHT, tuple(lines), tuple(grid))


def _project(points: np.ndarray) -> np.ndarray:
    """Return unscaled image coordinates, x to the right and y downwards, shape (n, 2), of points (n, 3)."""
    x, y, z = points.T
    right = np.cos(AZIMUTH) * x + np.sin(AZIMUTH) * y
    away = -np.sin(AZIMUTH) * x + np.cos(AZIMUTH) * y
    return np.column_stack([right, -(np.sin(ELEVATION) * away + np.cos(ELEVATION) * z)])


def _stroke(start: np.ndarray, end: np.ndarray) -> Stroke:
    return float(start[0]), float(start[1]), float(end[0]), float(end[1])


def _text(points: np.ndarray) -> str:
    return " ".join(f"{x:g},{y:g}" for x, y in points)


FOLDER = Path("recordings")  # where `lapwing run` writes logs
MOST = 200  # largest number of listed logs, the newest ones


class FlightSummary(NamedTuple):
    """Entry of a log in the list of flights."""

    name: str  # name of the file
    scene: str
    title: str
    recorded: str  # local date and time
    css_class: str  # "good", "warn" or "bad"
    outcome: str
    kind: str  # kind of the outcome
    vehicles: tuple[str, ...]
    numbers: tuple[KeyNumber, ...]
    trouble: int  # number of adverse events
    duration: float  # [s]
    picture: Picture | None
    tree: dict[str, Any]  # tables of the scene with all defaults
    error: str = ""  # reason why the log cannot be read

    def matches(self, words: Sequence[str]) -> bool:
        """Return True if every word, in lower case, occurs in the name, title, outcome or a vehicle's name."""
        text = " ".join((self.name, self.scene, self.title, self.outcome, *self.vehicles)).lower()
        return all(word in text for word in words)


class RecentFlights:
    """Summaries and reports of the logs of a folder, cached until a log changes."""

    def __init__(self, reports: Path, folder: Path = FOLDER):
        """Use a folder of logs; `reports` is the folder of report pages, written on demand."""
        self._folder, self._reports = folder, reports
        self._cache: dict[tuple[str, int], FlightSummary] = {}
        self._lock = threading.Lock()

    def names(self) -> list[str]:
        """Return the file names of the logs, the newest first, without those that are being written.

        That of a run that is starting is empty.
        """
        dated = []
        for path in self._folder.glob("*.mcap"):
            with suppress(OSError):  # deleted meanwhile
                status = path.stat()
                if S_ISREG(status.st_mode) and status.st_size and not is_locked(path):
                    dated.append((_recorded(path.stem, status.st_mtime_ns), path.name))
        return [name for _, name in sorted(dated, reverse=True)[:MOST]]

    def path(self, name: str) -> Path:
        """Return the path of a log of the folder. Raise KeyError for other names."""
        if name not in self.names():
            raise KeyError(name)
        return self._folder / name

    def summary(self, name: str) -> FlightSummary:
        """Return the summary of a log. Raise KeyError if the log does not exist."""
        path = self.path(name)
        key = (name, modification_time(path))
        with self._lock:
            if key not in self._cache:
                self._cache[key] = _summary(path)
            return self._cache[key]

    def read_all(self) -> None:
        """Read the summaries of all logs, the newest first, without logs that are deleted meanwhile."""
        for name in self.names():
            with suppress(KeyError):
                self.summary(name)

    def search(self, text: str) -> list[str]:
        """Return the names of the logs that match all words, the newest first."""
        words = text.lower().split()
        return [name for name in self.names() if not words or self.summary(name).matches(words)]

    def report(self, *names: str) -> Path:
        """Return the report of one log, or of an overlay of two. Raise KeyError or ValueError."""
        paths = [self.path(name) for name in names]
        stamp = "_".join(str(modification_time(path)) for path in paths)
        target = self._reports / f"{'_'.join(path.stem for path in paths)[:120]}_{stamp}.html"
        with self._lock:
            if not target.exists():
                write([Flight.read(path, only=SHOWN) for path in paths], target, view3d=True)
        return target


def _recorded(name: str, modified_ns: int) -> str:
    """Return the local date and time of a log by its name, which `lapwing run` gives, or else by its file."""
    if match := DATED.search(name):
        return "{} {}:{}:{}".format(*match.groups())
    return datetime.fromtimestamp(modified_ns * 1e-9).strftime("%Y-%m-%d %H:%M:%S")


def _summary(path: Path) -> FlightSummary:
    recorded = _recorded(path.stem, modification_time(path))[:-3]
    try:
        flights = [flight for flight in Flight.read_all(path, SHOWN) if len(flight.truth)]
        if not flights:
            raise ValueError("no flight in this log")
    except ValueError as error:
        reason = str(error).removeprefix(f"{path}: ")
        return FlightSummary(path.name, path.stem, "", recorded, "bad", "", "", (), (), 0, 0.0, None, {}, reason)
    worst = max(flights, key=lambda flight: MARKS.index(flight.outcome.mark))
    unmet = [text for flight in flights for text, met in own_criteria(flight).items() if not met]
    outcome = "; not met: ".join([str(worst.outcome), *dict.fromkeys(unmet)])
    run = worst.origin.scene.get("run", {})
    return FlightSummary(
        path.name,
        worst.metadata.get("scene") or path.stem,
        str(run.get("title", "")),
        recorded,
        "bad" if unmet else worst.outcome.mark,
        f"{worst.vehicle}: {outcome}" if len(flights) > 1 else outcome,
        worst.outcome.kind,
        tuple(flight.vehicle for flight in flights),
        tuple(key_numbers(worst)),
        sum(event.kind in TROUBLE for flight in flights for event in flight.events),
        float(worst.truth.times[-1] - worst.truth.times[0]),
        picture([flight.truth.position for flight in flights]),
        worst.origin.scene,
    )
