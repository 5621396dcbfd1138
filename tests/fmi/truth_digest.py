"""Digest of the topic of the true state, from a log or from the rows of its port."""

from pathlib import Path

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import encode
from lapwing.cosim.log import LogReader
from lapwing.messages.digest import Digest
from lapwing.messages.topics import TRUTH
from lapwing.services.process_table import create


def digest_of_rows(config: RunConfig, rows: np.ndarray) -> str:
    """Return the digest of one row for each tick, as the recorder computes it."""
    encoder = next(w for w in create(config, "plant").encoders if w.topic.name == TRUTH.name)
    ticks = np.arange(len(rows))
    digest = Digest()
    for batch in encode(encoder, config.port(encoder.port), config, ticks, rows):
        payloads = np.ascontiguousarray(batch.payloads).view(np.uint8).reshape(len(ticks), -1)
        digest.update_batch(TRUTH.name, batch.ticks * config.interval_ns, payloads)
    return digest.hexdigest()


def digest_of_log(path: Path) -> tuple[str, int]:
    """Return the digest and the number of messages."""
    digest, count = Digest(), 0
    with LogReader(path) as log:
        (topic,) = [topic for topic in log.topics() if topic.endswith("/ground_truth")]
        for _, _, time_ns, payload in log.messages([topic]):
            digest.update(TRUTH.name, time_ns, bytes(payload))
            count += 1
    return digest.hexdigest(), count
