"""Summary of a log: provenance, topics with counts, rates and sizes, and gaps."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from lapwing.cosim.config.provenance import CONFIG_FILE
from lapwing.cosim.log import LogReader

REGULAR = 0.9  # minimum share of equal intervals between messages of a regular topic
LONGER = 1.5  # smallest gap, over the usual interval


class Topic(NamedTuple):
    """A topic of a log."""

    name: str
    kind: str  # full name of the type
    messages: int
    size: int  # [bytes] size of the messages, uncompressed
    rate: float | None  # [Hz] None for an irregular topic
    gaps: int  # number of intervals that are longer than usual
    longest: float  # [s] longest gap; 0 without one


class Info(NamedTuple):
    """Summary of a log."""

    path: Path
    size: int  # [bytes] size of the file
    metadata: dict[str, str]
    files: tuple[str, ...]  # names of the attachments
    complete: bool  # False if the end of the log is missing
    start: float  # [s] time of the first message
    end: float  # [s] time of the last message
    topics: tuple[Topic, ...]
    other_versions: dict[str, str]  # difference of a topic's type from that of this version, by topic

    @property
    def missing(self) -> dict[str, str]:
        """Missing parts of the log by the command that needs them."""
        result = {}
        if not any(topic.name.endswith("/ground_truth") for topic in self.topics):
            result["report"] = "a topic /NAME/ground_truth"
        elif self.other_versions:
            result["report"] = result["replay"] = f"messages of this version: {'; '.join(self.other_versions.values())}"
        if CONFIG_FILE not in self.files:
            imported = self.metadata.get("mode") == "imported"
            result["resimulate"] = "a scene, it is a recorded flight" if imported else f"an attachment {CONFIG_FILE}"
        if "digest" not in self.metadata:
            result["verify"] = "a digest in its metadata"
        return result


def info(path: str | Path) -> Info:
    """Scan a log.

    Raises:
        ValueError: the log cannot be read.
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
        files, versions = tuple(log.attachments), log.incompatible_types()
        return Info(Path(path), size, log.metadata, files, log.complete, *span, topics, versions)


def _topic(name: str, kind: str, times_ns: np.ndarray, size: int) -> Topic:
    intervals = np.diff(times_ns)
    usual = int(np.median(intervals)) if len(intervals) else 0
    if usual <= 0 or np.mean(np.abs(intervals - usual) <= 1) < REGULAR:
        return Topic(name, kind, len(times_ns), size, None, 0, 0.0)
    gaps = intervals[intervals > LONGER * usual]
    longest = float(gaps.max()) * 1e-9 if len(gaps) else 0.0
    return Topic(name, kind, len(times_ns), size, 1e9 / usual, len(gaps), longest)
