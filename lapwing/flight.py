"""Flight with its exports: log, report, 3D view and plot."""

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lapwing.cosim.config.provenance import attachments, failure, metadata
from lapwing.cosim.diagram.block_diagram import to_record_batches
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.messages.topics import EVENTS
from lapwing.runs.log_events import event_messages
from lapwing.studies import flight_data as studied
from lapwing.studies.flight_topics import topic_of
from lapwing.studies.report import write
from lapwing.studies.report.overview import overview
from lapwing.studies.view3d.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Flight(studied.FlightData):
    """Recorded flight: its topics, and the outcome and metrics computed from them.

    `flight.truth.position` is an array by time, shape (n, 3) [m] in the world frame, `flight.truth.times` its times
    [s]; `flight.topic("gps/fix")` is any topic.

    Attributes:
        vehicle: name of the vehicle.
        failure: reason of an early end: an invalid state, or an error in a user's controller; "" otherwise.
        origin: log or run configuration of the flight.
    """

    def save(self, path: str | Path) -> Path:
        """Write the flight as an MCAP log, which Foxglove, PlotJuggler and `lapwing` open. Return its path.

        Raises:
            ValueError: the log cannot be written.
        """
        target = Path(path)
        if self.origin.recorded:
            try:
                shutil.copyfile(self.origin.source, target)
            except OSError as error:
                raise ValueError(f"{target}: cannot be written: {error.strerror or error}") from None
            return target
        setup, messages = self.setup, []
        for name in self.topics:
            topic = topic_of(name)
            messages += [(topic, time // setup.interval_ns, payload) for time, payload in self.topic(name).payloads()]
        pages = to_record_batches(messages)
        last = max((int(np.max(page.ticks)) for page in pages), default=0)
        log_metadata = metadata(setup, "memory") | (failure(self.failure, self.diverged) if self.failure else {})
        with LogWriter(target, log_metadata, attachments(setup, {})) as writer:
            recording = Recording(writer, setup)
            recording.write(pages, last)
            recording.finish()
            for time_ns, payload in [] if self.has("events") else event_messages(self.events):
                writer.write(EVENTS.key(self.vehicle), EVENTS.message, payload, time_ns, deterministic=False)
        return target

    def report(
        self, path: str | Path | None = None, compare_with: studied.FlightData | None = None, view3d: bool = True
    ) -> Path:
        """Write the report: a page for a browser (.html), or its plots (.pdf, .png).

        Args:
            path: path of the report; by default .html beside the log, or SCENE.html here for a flight in memory.
            compare_with: second flight, drawn over this one in every plot.
            view3d: True to include the 3D view if viser is installed (`pip install lapwing[view3d]`).

        Returns:
            The report's path.

        Raises:
            ValueError: the file cannot be written, or has another extension.
        """
        source = Path(self.origin.source)
        flights = self._with(compare_with)
        return write(flights, Path(path) if path else source.with_suffix(".html"), view3d)

    def view(self, compare_with: studied.FlightData | None = None, height: int = 480) -> View:
        """Return the 3D view of the flight; a notebook shows it, `save` writes it to a page.

        Args:
            compare_with: second flight, drawn translucent beside this one.
            height: of the notebook cell [pixel].

        Raises:
            ValueError: viser is not installed.
        """
        from lapwing.studies.report.sections import labels
        from lapwing.studies.view3d.recording import page

        flights = self._with(compare_with)
        return View(page(flights, labels(flights)), height)

    def _with(self, other: studied.FlightData | None) -> list[studied.FlightData]:
        """Return this flight and the other one. Raise ValueError if the other one is not a flight."""
        if other is not None and not isinstance(other, studied.FlightData):
            raise ValueError(f"compare_with: expected a flight, for example lapwing.read_log(path), got {other!r}")
        return [self] if other is None else [self, other]

    def plot(self, path: str | Path | None = None) -> "Figure":
        """Plot displacements and references over time, and the path in space.

        Args:
            path: also write the plot to this file: .png, .svg or .pdf.

        Returns:
            The matplotlib figure; a notebook shows it.

        Raises:
            ValueError: the plot cannot be written.
        """
        from lapwing.studies.report.matplotlib_figure import (  # matplotlib takes half a second to import
            figure,
            plot_style,
        )

        with plot_style():
            plot_figure = figure(overview(self))
            if path is not None:
                try:
                    plot_figure.savefig(path)
                except OSError as error:
                    raise ValueError(f"{path}: cannot be written: {error.strerror or error}") from None
        return plot_figure
