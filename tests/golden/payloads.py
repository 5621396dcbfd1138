"""Print a hash of the ticks and payloads of each topic of the golden scenes: `python -m tests.golden.payloads`.

Topic and field names do not enter the hashes, so the output of two commits that differ only in names is equal but for
the names of the topics.
"""

import hashlib
import sys

from tests.golden.__main__ import fly
from tests.golden.cases import CASES


def main() -> None:
    """Print one line per scene and topic: scene, topic, number of messages, hash."""
    for name in sys.argv[1:] or CASES:
        log, _ = fly(name)
        for topic in log.topics:
            messages = log.payloads(topic)
            data = b"".join(tick.to_bytes(8, "little") + payload for tick, payload in messages)
            print(name, topic, len(messages), hashlib.blake2b(data, digest_size=16).hexdigest(), flush=True)


if __name__ == "__main__":
    main()
