"""A flight with the ways out of memory: a log, a page."""

import shutil
from pathlib import Path

import numpy as np

from cosim.graph import pages_of
from cosim.log import LogWriter
from cosim.provenance import attachments, metadata
from cosim.recording import Recording
from messages.topics import TOPICS
from studies import flight as studied
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
        setup, known = self.setup, {topic.key(self.vehicle): topic for topic in TOPICS}
        said = []
        for name in self.topics:
            topic = known.get(f"/{self.vehicle}/{name}") or known[f"/{name}"]
            said += [(topic, time // setup.interval_ns, payload) for time, payload in self.topic(name).payloads()]
        pages = pages_of(said)
        last = max((int(np.max(page.ticks)) for page in pages), default=0)
        with LogWriter(target, metadata(setup, "memory"), attachments(setup, {})) as writer:
            Recording(writer, setup).write(pages, last)
        return target

    def report(self, path: str | Path | None = None, beside: studied.Flight | None = None) -> Path:
        """Write the report: a page for a browser (.html), or its plots on paper (.pdf, .png); its path.

        Args:
            path: of the report, by default an .html beside the log.
            beside: another flight, laid over this one in every plot.

        Raises:
            ValueError: it cannot be written, or the name has another ending.
        """
        source = Path(self.origin.source)
        flights = [self] if beside is None else [self, beside]
        return write(flights, Path(path) if path else source.with_suffix(".html"))
