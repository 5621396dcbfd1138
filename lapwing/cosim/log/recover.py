"""Recovery of a damaged log, or of one whose recorder was killed, into a complete log."""

from pathlib import Path
from typing import NamedTuple

from lapwing.cosim.log.log_reader import LogReader
from lapwing.cosim.log.log_writer import LogWriter

RECOVERED = "recovered"  # key in the metadata: the original file, and its defects


class RecoveryResult(NamedTuple):
    """Messages that `recover` has saved from a damaged log."""

    messages: int
    end_ns: int  # time of the last message
    damaged: tuple[str, ...]  # a line for each chunk that was left out
    digest: str  # digest of the recovered messages


def recover(path: Path, out: Path) -> RecoveryResult:
    """Write all complete chunks of a log into a new log, with index, digest and end.

    Raises:
        ValueError: `path` is not an MCAP log, is undamaged, or has other message types, or `out` cannot be written.
    """
    with LogReader(path, skip_damaged=True) as log:
        if log.complete and not log.damaged:
            raise ValueError(f"{path}: is complete and undamaged; no recovery is needed")
        log.check_versions()
        defects = "; ".join([*log.damaged, *([] if log.complete else ["it has no end"])])
        metadata = {key: value for key, value in log.metadata.items() if key != "digest"}
        deterministic, count, end_ns = log.deterministic_topics(), 0, 0
        try:
            with LogWriter(out, metadata | {RECOVERED: f"{path.name}: {defects}"}, dict(log.attachments)) as writer:
                for topic, kind, time_ns, payload in log.messages():
                    writer.write(topic, kind, payload, time_ns, topic in deterministic)
                    count, end_ns = count + 1, time_ns
        except ValueError:
            out.unlink(missing_ok=True)
            raise
        return RecoveryResult(count, end_ns, log.damaged, writer.metadata["digest"])
