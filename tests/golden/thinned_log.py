"""Sample of a flight that shows when another flight first differs, in which field, and by how much."""

import hashlib
import json
import math
import zlib
from collections.abc import Iterator
from itertools import accumulate, pairwise
from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.log import LogReader, LogWriter
from lapwing.messages import message_class
from lapwing.messages.message_diff import first_difference as first_field
from tests.cosim.memory_log import MemoryLog

FINGERPRINTS, KEPT = 200, 10  # approximate numbers per topic
LARGE = 2000  # [bytes] of a message; a topic of larger messages keeps only the first
HASHES_FILE = "fingerprints.json.zlib"


class TopicSample(NamedTuple):
    """Sampled messages of a topic."""

    every: int  # messages between two fingerprints
    fingerprints: list[str]  # of the first `every` messages, of the first 2 `every`, ..., of all
    instants: list[int]  # [ns] of the last message of each fingerprint
    kept: list[tuple[int, str, bytes]]  # (time [ns], type, payload) of a few messages


Sample = dict[str, TopicSample]  # by name in the log


def take(log: MemoryLog) -> Sample:
    """Return the sample of a flight."""
    result = {}
    for name, topic in log.topics.items():
        messages = [(tick * log.config.interval_ns, payload) for tick, payload in log.payloads(name)]
        every = math.ceil(len(messages) / FINGERPRINTS)
        fingerprints, instants = _fingerprints(messages, every)
        large = bool(messages) and len(messages[0][1]) > LARGE
        places = (
            [0]
            if large
            else sorted({0, 1, *range(0, len(messages), math.ceil(len(messages) / KEPT)), len(messages) - 1})
        )
        kept = [(messages[i][0], topic.message.type_name, messages[i][1]) for i in places if i < len(messages)]
        result[topic.key(log.config.vehicle)] = TopicSample(every, fingerprints, instants, kept)
    return result


def _fingerprints(messages: list[tuple[int, bytes]], every: int) -> tuple[list[str], list[int]]:
    running, fingerprints, instants = hashlib.blake2b(digest_size=4), [], []
    for i, (time_ns, payload) in enumerate(messages, 1):
        running.update(time_ns.to_bytes(8, "little") + payload)
        if i % every == 0 or i == len(messages):
            fingerprints.append(running.copy().hexdigest())
            instants.append(time_ns)
    return fingerprints, instants


def _steps(instants: list[int]) -> list[int]:
    """Return the first instant and the differences between instants, which compress better."""
    return [b - a for a, b in pairwise([0, *instants])]


def write(path: Path, sample: Sample) -> None:
    """Write a sample as a log of its messages, with the fingerprints as an attachment."""
    table = {name: [topic.every, topic.fingerprints, _steps(topic.instants)] for name, topic in sample.items()}
    with LogWriter(path, {}, {HASHES_FILE: zlib.compress(json.dumps(table).encode(), 9)}) as log:
        messages = [(time_ns, name, kind, payload) for name, t in sample.items() for time_ns, kind, payload in t.kept]
        for time_ns, name, kind, payload in sorted(messages, key=lambda message: message[0]):
            log.write(name, kind, payload, time_ns)


def read(path: Path) -> Sample:
    """Return a sample written by `write`."""
    with LogReader(path) as log:
        table = json.loads(zlib.decompress(log.attachments[HASHES_FILE]))
        result = {name: TopicSample(row[0], row[1], list(accumulate(row[2])), []) for name, row in table.items()}
        for name, kind, time_ns, payload in log.messages():
            result[name].kept.append((time_ns, kind, payload))
    return result


def first_difference(old: Sample, new: MemoryLog, whole: bool = True) -> list[str]:
    """Return the lines of the first difference between a flight and a sample; empty without one.

    Args:
        old: sample.
        new: flight.
        whole: True if it was flown to its end; otherwise only its beginning is compared.
    """
    names = {topic.key(new.config.vehicle): name for name, topic in new.topics.items()}
    lines = [f"{name}: this topic is new" for name in sorted(names.keys() - old.keys())]
    lines += [f"{name}: this topic is gone" for name in sorted(old.keys() - names.keys())]
    end_ns = math.inf if whole else max(new.payloads(name)[-1][0] for name in new.topics) * new.config.interval_ns
    began: list[tuple[int, int, str]] = []
    fields: list[tuple[int, str]] = []
    for name in sorted(old.keys() & names.keys()):
        messages = [(tick * new.config.interval_ns, payload) for tick, payload in new.payloads(names[name])]
        began += _began(name, old[name], messages, end_ns)
        fields += _fields(name, old[name], messages, end_ns)
    if began:
        last_alike, at_or_before, name = min(began)
        since = f"after t = {last_alike * 1e-9:g} s, " if last_alike >= 0 else ""
        lines.append(f"{name}: differs first, {since}at or before t = {at_or_before * 1e-9:g} s")
    if fields:
        lines.append(min(fields)[1])
    return lines


def _began(
    name: str, old: TopicSample, messages: list[tuple[int, bytes]], end_ns: float
) -> Iterator[tuple[int, int, str]]:
    """Yield (last equal instant, first instant known to differ, topic) of the first difference up to `end_ns`."""
    fingerprints, _ = _fingerprints(messages, old.every)
    alike = -1
    for i, (was, instant) in enumerate(zip(old.fingerprints, old.instants, strict=True)):
        if instant > end_ns:
            return
        if i >= len(fingerprints) or was != fingerprints[i]:
            yield alike, instant, name
            return
        alike = instant
    if len(messages) > 0 and messages[-1][0] > alike:
        yield alike, messages[-1][0], name


def _fields(name: str, old: TopicSample, messages: list[tuple[int, bytes]], end_ns: float) -> Iterator[tuple[int, str]]:
    """Yield (instant, line) of the first sampled message that differs, up to `end_ns`."""
    new: dict[int, list[bytes]] = {}
    for time_ns, payload in messages:
        new.setdefault(time_ns, []).append(payload)
    for time_ns, kind, was in old.kept:
        now = new.get(time_ns, [])
        if was in now or time_ns > end_ns:
            continue
        where = f"{name} at t = {time_ns * 1e-9:g} s: "
        if not now:
            yield time_ns, where + "there is no such message any more"
            return
        # a topic of a fleet has a message of each vehicle: those of other vehicles differ in a name
        results = [first_field(message_class(kind), was, payload) for payload in now]
        result = next((r for r in results if r and r.delta is not None), results[0])
        assert result
        by = f", by {result.delta:.3g}" if result.delta is not None else ""
        yield time_ns, where + f"{result.field or 'length'} was {result.one!r}, is {result.other!r}{by}"
        return
