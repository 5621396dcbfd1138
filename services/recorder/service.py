"""The recorder process: every recorded topic into one MCAP log, complete to the last tick."""

from pathlib import Path
from typing import Any

import numpy as np

from cosim.bundle import unpack_batch
from cosim.keys import BATCH_KEY, DIVERGED_KEY
from cosim.log import LogWriter
from cosim.process import Process, Stopped
from cosim.provenance import attachments, failure, metadata
from cosim.recording import Recording
from cosim.wire import Page


def run(process: Process, given: Any) -> None:
    """Record until every service has said that it has ended, or until asked to stop; the log is readable either way."""
    setup, prefix = process.setup, f"{process.key_prefix}/{BATCH_KEY}"
    diverged = f"{process.key_prefix}/{DIVERGED_KEY}"
    news = process.bus.subscribe(f"{prefix}/*", f"{diverged}/*")
    pending = Pending(setup.services)
    about = metadata(setup, given.mode) | ({"external": ", ".join(given.external)} if given.external else {})
    with LogWriter(Path(given.log), about, attachments(setup, given.sources or {})) as writer:
        recording = Recording(writer, setup)
        try:
            process.join()
            while not pending.ended:
                key, _, payload = process.patient(news.get_with_key, pending.waits_for)
                if key.startswith(diverged):
                    writer.metadata |= failure(payload.decode(), diverged=True)
                    continue
                pending.add(key.rsplit("/", 1)[1], payload)
                pages = pending.complete()
                if pages:
                    recording.write(pages, pending.written - 1)
        except Stopped:
            writer.metadata = failure("the run was ended") | writer.metadata


class Pending:
    """Pages that have come, held back until every service has handed over their ticks."""

    def __init__(self, services: Any):
        """Of a run of these services."""
        self._stop = dict.fromkeys(services, 0)  # tick before which each has handed over all
        self._left = set(services)  # those that have not ended
        self._pages: list[Page] = []
        self.written = 0  # tick before which all is complete

    @property
    def ended(self) -> bool:
        """Whether nobody will hand over more."""
        return not self._left

    def add(self, name: str, payload: bytes) -> None:
        """A batch of a service; an empty one is its last."""
        if not payload:
            self._left.discard(name)
            return
        self._stop[name], pages = unpack_batch(payload)
        self._pages += pages

    def complete(self) -> list[Page]:
        """The pages of the ticks that are complete now."""
        stop = min(self._stop.values())
        if stop <= self.written:
            return []
        self.written = stop
        done, left = [], []
        for page in self._pages:
            k = int(np.searchsorted(page.ticks, stop))
            if k > 0:
                done.append(Page(page.topic, page.ticks[:k], page.payloads[:k]))
            if k < len(page.ticks):
                left.append(Page(page.topic, page.ticks[k:], page.payloads[k:]))
        self._pages = left
        return done

    def waits_for(self) -> str:
        """Who has handed over least."""
        name = min(self._stop, key=lambda n: self._stop[n])
        return f"the messages of {name} from tick {self._stop[name]} on"
