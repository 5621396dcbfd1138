"""Logs in the folder of recordings: summary, picture and report of each."""

import threading
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from lapwing.cosim.output_lock import is_locked, modification_time
from lapwing.flight import Flight
from lapwing.studies.flight_data import SHOWN
from lapwing.studies.metrics import unmet_criteria
from lapwing.studies.report import write
from lapwing.studies.report.key_numbers import TROUBLE, KeyNumber, key_numbers
from lapwing.studies.report.page import CSS_CLASSES
from lapwing.studio.path_picture import Picture, picture

FOLDER = Path("recordings")  # where `lapwing run` writes logs
MOST = 200  # largest number of listed logs, the newest ones


class FlightSummary(NamedTuple):
    """Entry of a log in the list of flights."""

    name: str  # name of the file
    scene: str
    title: str
    recorded: str  # local date and time
    css_class: str  # "good" or "bad"
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
        """Return the file names of the logs, the newest first, without those that are being written."""
        paths = [path for path in self._folder.glob("*.mcap") if path.is_file()] if self._folder.is_dir() else []
        dated = [
            (modified, path.name) for path in paths if (modified := modification_time(path)) and not is_locked(path)
        ]
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


def _summary(path: Path) -> FlightSummary:
    recorded = datetime.fromtimestamp(modification_time(path) * 1e-9).strftime("%Y-%m-%d %H:%M")
    try:
        flights = [flight for flight in Flight.read_all(path, SHOWN) if len(flight.truth)]
        if not flights:
            raise ValueError("no flight in this log")
    except ValueError as error:
        reason = str(error).removeprefix(f"{path}: ")
        return FlightSummary(path.name, path.stem, "", recorded, "bad", "", "", (), (), 0, 0.0, None, {}, reason)
    worst = max(flights, key=lambda flight: flight.outcome.kind not in CSS_CLASSES)
    unmet = [text for flight in flights for text in unmet_criteria(flight)]
    outcome = "; not met: ".join([str(worst.outcome), *dict.fromkeys(unmet)])
    run = worst.origin.scene.get("run", {})
    return FlightSummary(
        path.name,
        worst.metadata.get("scene") or path.stem,
        str(run.get("title", "")),
        recorded,
        "bad" if unmet else CSS_CLASSES.get(worst.outcome.kind, "bad"),
        f"{worst.vehicle}: {outcome}" if len(flights) > 1 else outcome,
        worst.outcome.kind,
        tuple(flight.vehicle for flight in flights),
        tuple(key_numbers(worst)),
        sum(event.kind in TROUBLE for flight in flights for event in flight.events),
        float(worst.truth.times[-1] - worst.truth.times[0]),
        picture([flight.truth.position for flight in flights]),
        worst.origin.scene,
    )
