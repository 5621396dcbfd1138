"""Recovery of a damaged log, or of one whose recorder was killed, into a complete log."""

from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.log.log_reader import LogReader
from lapwing.cosim.log.log_writer import LogWriter

RECOVERED = "recovered"  # key in the metadata: from which file, and what it lacked


class RecoveryResult(NamedTuple):
    """Messages that `recover` has saved from a damaged log."""

    messages: int
    end_ns: int  # time of the last message
    damaged: tuple[str, ...]  # what was left out, a line each
    digest: str  # of what was found


def recover(path: Path, out: Path) -> RecoveryResult:
    """Write all whole chunks of a log into a new one, in their order, with index, digest and end.

    Raises:
        ValueError: no MCAP log, one that is whole, one of other types of messages, or `out` cannot be written.
    """
    with LogReader(path, skip_damaged=True) as log:
        if log.complete and not log.damaged:
            raise ValueError(f"{path}: has its end and no damage; there is nothing to recover")
        log.check_versions()
        lacked = "; ".join([*log.damaged, *([] if log.complete else ["it has no end"])])
        about = {key: value for key, value in log.metadata.items() if key != "digest"}
        deterministic, count, end_ns = log.deterministic_topics(), 0, 0
        try:
            with LogWriter(out, about | {RECOVERED: f"{path.name}: {lacked}"}, dict(log.attachments)) as writer:
                for topic, kind, time_ns, payload in log.messages():
                    writer.write(topic, kind, payload, time_ns, topic in deterministic)
                    count, end_ns = count + 1, time_ns
        except ValueError:
            out.unlink(missing_ok=True)
            raise
        return RecoveryResult(count, end_ns, log.damaged, writer.metadata["digest"])
