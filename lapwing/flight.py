"""A flight with the ways out of memory: a log, a page."""

import shutil
from pathlib import Path

import numpy as np

from cosim.graph import pages_of
from cosim.log import LogWriter
from cosim.provenance import attachments, metadata
from cosim.recording import Recording
from studies import flight as studied
from studies.flight import topic_of
from studies.report import write


class Flight(studied.Flight):
    """What was said in a flight, topic by topic, and what that comes to; see `studies.flight.Flight`."""

    def save(self, path: str | Path) -> Path:
        """Write the flight as an MCAP log; its path.

        Raises:
            ValueError: the log cannot be written.
        """
        target = Path(path)
        if self.origin.recorded:
            try:
                shutil.copyfile(self.origin.source, target)
            except OSError as fault:
                raise ValueError(f"{target}: cannot be written: {fault.strerror or fault}") from None
            return target
        setup, said = self.setup, []
        for name in self.topics:
            topic = topic_of(name)
            said += [(topic, time // setup.interval_ns, payload) for time, payload in self.topic(name).payloads()]
        pages = pages_of(said)
        last = max((int(np.max(page.ticks)) for page in pages), default=0)
        with LogWriter(target, metadata(setup, "memory"), attachments(setup, {})) as writer:
            Recording(writer, setup).write(pages, last)
        return target

    def report(self, path: str | Path | None = None) -> Path:
        """Write the report, an HTML page; its path, by default beside the log.

        Raises:
            ValueError: it cannot be written.
        """
        source = Path(self.origin.source)
        return write(self, Path(path) if path else source.with_suffix(".html"))
