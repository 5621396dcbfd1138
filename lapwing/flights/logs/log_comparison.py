"""First difference of two logs, and its growth.

Kernels and resolvers use Lapwing's elementary functions in double precision, so results do not depend on C library,
processor, and versions of numba, llvmlite and numpy (`make portability`, `make compatibility`). They depend on
Lapwing's source and on the user's modules.
"""

from collections.abc import Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.provenance import MACHINE, machine, source_commit
from lapwing.cosim.log import LogReader
from lapwing.messages import TYPES
from lapwing.messages.message_diff import first_difference

AFTER = (0.0, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0, 10000.0)  # [s] times of the reported growth, besides the end
ABOUT = ("scene", "seed", "config", "version", "commit")  # metadata that may explain a difference


class Growth(NamedTuple):
    """Difference of a field of two logs some time after their first difference."""

    after: float  # [s]
    apart: float  # Euclidean distance of the two values
    position: float | None  # [m] distance of the true positions; None if a log has none at that time


class Difference(NamedTuple):
    """The first message at which two logs differ."""

    topic: str
    time_ns: int
    field: str  # dotted name; "" if only one log has the message, or its type is unknown
    values: tuple[Any, Any]  # values in the two logs
    growth: tuple[Growth, ...]  # empty if the field is not numeric


class Comparison(NamedTuple):
    """Comparison of two logs."""

    about: dict[str, tuple[str, str]]  # differing metadata of the two logs
    only: tuple[tuple[str, ...], tuple[str, ...]]  # topics that only the first and only the second log has
    first: Difference | None

    @property
    def same(self) -> bool:
        """True if both logs have the same deterministic messages."""
        return self.first is None and not any(self.only)


def compare(one: str | Path, other: str | Path) -> Comparison:
    """Compare the deterministic messages of two logs.

    Raises:
        ValueError: a log cannot be read, or has another version.
    """
    with LogReader(one) as a, LogReader(other) as b:
        keys = [key for key in ABOUT if a.metadata.get(key) != b.metadata.get(key)]
        about = {key: (a.metadata.get(key, ""), b.metadata.get(key, "")) for key in keys}
        topics = a.deterministic_topics(), b.deterministic_topics()
        a.check_versions(topics[0])
        b.check_versions(topics[1])
        only = tuple(sorted(topics[0] - topics[1])), tuple(sorted(topics[1] - topics[0]))
        return Comparison(about, only, _first(a, b, topics[0] & topics[1]))


def _first(a: LogReader, b: LogReader, topics: set[str]) -> Difference | None:
    types = a.topics()
    one, other = _instants(a, topics), _instants(b, topics)
    first, second = next(one, None), next(other, None)
    while first or second:
        if first == second:
            first, second = next(one, None), next(other, None)
            continue
        time_ns = min(instant[0] for instant in (first, second) if instant)
        messages = [instant[1] if instant and instant[0] == time_ns else {} for instant in (first, second)]
        for topic in {**messages[0], **messages[1]}:  # in the order of the log
            payloads = [by_topic.get(topic, []) for by_topic in messages]
            if payloads[0] != payloads[1]:
                return _difference(a, b, topic, types[topic], time_ns, *payloads)
    return None


def _instants(log: LogReader, topics: set[str]) -> Iterator[tuple[int, dict[str, list[bytes]]]]:
    """Yield each time [ns] with the payloads of each topic."""
    for time_ns, group in groupby(log.messages(topics), key=lambda message: message[2]):
        payloads: dict[str, list[bytes]] = {}
        for topic, _, _, payload in group:
            payloads.setdefault(topic, []).append(payload)
        yield time_ns, payloads


def _difference(
    a: LogReader, b: LogReader, topic: str, kind: str, time_ns: int, one: list[bytes], other: list[bytes]
) -> Difference:
    if len(one) != len(other) or kind not in TYPES:
        texts = (f"{len(one)} messages", f"{len(other)} messages") if len(one) != len(other) else ("", "")
        return Difference(topic, time_ns, "", texts, ())
    pair = next((x, y) for x, y in zip(one, other, strict=True) if x != y)
    result = first_difference(TYPES[kind], *pair)
    assert result
    growth = _growth(a, b, topic, result.field, time_ns)
    return Difference(topic, time_ns, result.field, (result.one, result.other), growth)


def _growth(a: LogReader, b: LogReader, topic: str, field: str, first_ns: int) -> tuple[Growth, ...]:
    """Return the growth of the distance of the vector that contains the field, at common times of both logs."""
    times, apart = _distances(a, b, topic, (field.rpartition(".")[0], field))
    if not len(times):
        return ()
    truth = next((name for name in a.topics() if name.endswith("/ground_truth") and name in b.topics()), None)
    position_times, distances = _distances(a, b, truth, ("pose.position",)) if truth else (times[:0], apart[:0])
    position = dict(zip(position_times.tolist(), distances.tolist(), strict=True))
    after = (times - first_ns) * 1e-9
    moments = [seconds for seconds in AFTER if seconds < after[-1]] + [float(after[-1])]
    rows = dict.fromkeys(int(np.searchsorted(after, seconds - 1e-9)) for seconds in moments)
    return tuple(Growth(float(after[k]), float(apart[k]), position.get(int(times[k]))) for k in rows)


def _distances(a: LogReader, b: LogReader, topic: str, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return times [ns] and distances, shape (n,), of the first field that is numeric in both logs, or empty."""
    (times_a, one), (times_b, other) = a.history(topic), b.history(topic)
    name = next((name for name in names if name in one and name in other), "")
    values = [np.asarray(columns[name]) if name else np.empty(0, object) for columns in (one, other)]
    if (
        values[0].dtype.kind not in "biuf"
        or values[0].dtype != values[1].dtype
        or values[0].shape[1:] != values[1].shape[1:]
    ):
        return np.empty(0, np.int64), np.empty(0)
    times, rows_a, rows_b = np.intersect1d(times_a, times_b, return_indices=True)
    difference = values[1][rows_b].astype(float) - values[0][rows_a].astype(float)
    return times, np.linalg.norm(difference.reshape(len(times), -1), axis=1)


UNKNOWN = "unknown"


class Fact(NamedTuple):
    """Property of the machine that recorded a log, and of this machine."""

    name: str
    recorded: str
    here: str


def facts(metadata: Mapping[str, str]) -> list[Fact]:
    """Return the properties in a log's metadata with those of this machine."""
    here = {"commit": source_commit(), **machine()}
    return [Fact(name, metadata.get(name, UNKNOWN), here[name]) for name in ("commit", *MACHINE)]


def expectation(metadata: Mapping[str, str]) -> str:
    """Return a sentence on the expected result of resimulation on this machine."""
    if metadata.get("mode") == "imported":
        return "imported from another program: resimulation is not possible"
    recorded, here = metadata.get("commit", UNKNOWN), source_commit()
    if UNKNOWN in (recorded, here):
        return "unknown: one of the two commits of Lapwing is not known; resimulate the log"
    if recorded.endswith("+") or here.endswith("+"):
        return "unknown: Lapwing's source had uncommitted changes; resimulate the log"
    if recorded != here:
        return f"not certain: recorded by another commit of Lapwing; check out {recorded}, or resimulate the log"
    return "equal: same commit of Lapwing; processor, C library and packages do not change bits"
