"""Summary of a log: provenance, topics with counts, rates and sizes, and gaps."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from lapwing.cosim.config.provenance import SETUP_FILE
from lapwing.cosim.log import LogReader

REGULAR = 0.9  # of the intervals between messages that are alike, from which on others are gaps
LONGER = 1.5  # times the usual interval is a gap


class Topic(NamedTuple):
    """A topic of a log."""

    name: str
    kind: str  # full name of its type
    messages: int
    size: int  # [bytes] of its messages, not compressed
    rate: float | None  # [Hz], None where its messages come at no regular rate
    gaps: int  # intervals that are longer than usual
    longest: float  # [s], the longest of them; 0 where there is none


class Info(NamedTuple):
    """Summary of a log."""

    path: Path
    size: int  # [bytes] of the file
    metadata: dict[str, str]
    files: tuple[str, ...]  # attached
    complete: bool  # whether it has its end
    start: float  # [s] of the first message
    end: float  # [s] of the last message
    topics: tuple[Topic, ...]
    other_versions: dict[str, str]  # what the type of a topic has otherwise than this version's

    @property
    def missing(self) -> dict[str, str]:
        """Commands that cannot use the log, with what it lacks for each."""
        result = {}
        if not any(topic.name.endswith("/ground_truth") for topic in self.topics):
            result["report"] = "a topic /NAME/ground_truth"
        elif self.other_versions:
            result["report"] = result["replay"] = f"messages of this version: {'; '.join(self.other_versions.values())}"
        if SETUP_FILE not in self.files:
            result["resimulate"] = f"an attachment {SETUP_FILE}"
        if "digest" not in self.metadata:
            result["verify"] = "a digest in its metadata"
        return result


def info(path: str | Path) -> Info:
    """Scan a log.

    Raises:
        ValueError: it cannot be read.
    """
    with LogReader(path) as log:
        times: dict[str, list[int]] = {topic: [] for topic in log.topics()}
        sizes = dict.fromkeys(times, 0)
        for topic, _, time_ns, payload in log.messages():
            times[topic].append(time_ns)
            sizes[topic] += len(payload)
        topics = tuple(_topic(n, kind, np.array(times[n], np.int64), sizes[n]) for n, kind in log.topics().items())
        instants = [t for of_topic in times.values() for t in of_topic[:: max(1, len(of_topic) - 1)]]
        span = (min(instants) * 1e-9, max(instants) * 1e-9) if instants else (0.0, 0.0)
        size = Path(path).stat().st_size
        return Info(
            Path(path),
            size,
            log.metadata,
            tuple(log.attachments),
            log.complete,
            *span,
            topics,
            log.incompatible_types(),
        )


def _topic(name: str, kind: str, times_ns: np.ndarray, size: int) -> Topic:
    intervals = np.diff(times_ns)
    usual = int(np.median(intervals)) if len(intervals) else 0
    if usual <= 0 or np.mean(np.abs(intervals - usual) <= 1) < REGULAR:
        return Topic(name, kind, len(times_ns), size, None, 0, 0.0)
    gaps = intervals[intervals > LONGER * usual]
    longest = float(gaps.max()) * 1e-9 if len(gaps) else 0.0
    return Topic(name, kind, len(times_ns), size, 1e9 / usual, len(gaps), longest)
