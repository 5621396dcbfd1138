"""Recorder process: writes all recorded topics to one MCAP log, complete to the last tick."""

import json
from pathlib import Path
from typing import Any

from lapwing.cosim.config.provenance import ENDED, WAITED, attachments, failure, metadata
from lapwing.cosim.diagram.topic_encoder import RecordBatch, split_at
from lapwing.cosim.executors.log_backpressure import LogProgressPublisher
from lapwing.cosim.executors.participant import Participant, Stopped
from lapwing.cosim.executors.realtime import Lateness, lateness, metadata_entries
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.bus_keys import BATCH_KEY, DEADLINES_KEY, DIVERGED_KEY, ENDED_KEY, LOGGED_KEY, REPORTS_KEY
from lapwing.cosim.transport.packets import unpack_log_packet

REPORTED_WAIT = 1.0  # [s] of waiting for the disk above which the log's metadata reports it


def run(process: Participant, spec: Any) -> None:
    """Record until all services have ended. The log is readable however the run ends.

    Args:
        process: this process as a participant of the run.
        spec: its `ProcessSpec`.

    Raises:
        Stopped: this process was requested to end.
        LockStepError: a log packet is missing, or a participant did not appear or confirm.
        ValueError: the log cannot be written.
    """
    config = process.config
    senders: dict[str, bytes | None] = {}
    late: dict[str, Lateness] = {}
    for key in (BATCH_KEY, DEADLINES_KEY, DIVERGED_KEY, ENDED_KEY, REPORTS_KEY):
        senders |= process.participants.senders(key, config.services)
    pending = Pending(config.services)
    messages = process.bus.receive(senders)
    log_metadata = metadata(config, spec.mode) | ({"external": ", ".join(spec.external)} if spec.external else {})
    progress = LogProgressPublisher(process.bus, process.key_prefix, process.name)
    with LogWriter(Path(spec.log), log_metadata, attachments(config, spec.sources or {}), progress.waiting) as writer:
        recording = Recording(writer, config)
        try:
            process.join()
            while not pending.ended:
                key, time_ns, payload = process.wait_with_status(messages.get_with_key, pending.waits_for)
                head, name = key.split("/")[-2:]
                if head == DEADLINES_KEY:
                    late[name] = lateness(payload.decode(errors="replace"))
                    continue
                if head == REPORTS_KEY:
                    writer.metadata |= _entries(payload)
                    continue
                if head != BATCH_KEY:
                    if payload:  # an empty reason is the normal end of the run
                        text = payload.decode(errors="replace")  # the first cause counts
                        writer.metadata = failure(text, head == DIVERGED_KEY) | writer.metadata
                    continue
                pending.add(name, payload, time_ns // config.interval_ns)
                batches = pending.complete()
                if batches:
                    recording.write(batches, pending.written - 1)
                    process.report_rejected()
                progress.recorded(pending.written)  # also if no tick was completed: shows that the recorder runs
            process.confirm()
        except Stopped:
            writer.metadata = failure(ENDED) | writer.metadata
            raise
        except LockStepError as error:
            writer.metadata = failure(str(error)) | writer.metadata
            raise
        finally:
            recording.finish()
            writer.metadata |= metadata_entries(late)
            if writer.waited >= REPORTED_WAIT:
                writer.metadata[WAITED] = f"{writer.waited:.1f} s"
    progress.end()
    process.leave(progress.end, LOGGED_KEY, [MONITOR])


def _entries(payload: bytes) -> dict[str, str]:
    """Return the metadata entries of a service, {} if they cannot be read."""
    try:
        result = json.loads(payload)
        return {str(key): str(text) for key, text in result.items()}
    except (ValueError, AttributeError):
        return {}


class Pending:
    """Buffer of record batches until every service has published their ticks."""

    def __init__(self, services: Any):
        """Create an empty buffer for these services."""
        self._stop = dict.fromkeys(services, 0)  # first tick that each has not published
        self._unfinished = set(services)  # services that have not ended
        self._batches: list[RecordBatch] = []
        self.written = 0  # all ticks before this one are complete

    @property
    def ended(self) -> bool:
        """True if no service will publish more."""
        return not self._unfinished

    def add(self, name: str, payload: bytes, end: int) -> None:
        """Add a log packet of a service; an empty one declares that the service has ended before the tick `end`.

        Raises:
            LockStepError: a previous packet is missing.
        """
        if not payload:
            self._check(name, end)
            self._unfinished.discard(name)
            return
        start, stop, batches = unpack_log_packet(payload)
        self._check(name, start)
        self._batches += batches
        self._stop[name] = stop

    def _check(self, name: str, tick: int) -> None:
        if tick > self._stop[name]:
            first = self._stop[name]
            raise LockStepError(f"recorder: the messages of {name} of the ticks {first} to {tick - 1} are lost")

    def complete(self) -> list[RecordBatch]:
        """Return the record batches of the complete ticks."""
        stop = min(self._stop.values())
        if stop <= self.written:
            return []
        self.written = stop
        complete, self._batches = split_at(self._batches, stop)
        return complete

    def waits_for(self) -> str:
        """Return a text that names the service that is furthest behind."""
        name = min(self._stop, key=lambda n: self._stop[n])
        return f"the messages of {name} from tick {self._stop[name]} on"
