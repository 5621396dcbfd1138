"""Flight with its exports: log, report, 3D view and plot."""

import html
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lapwing.cosim.complete_file import write_text
from lapwing.cosim.config.provenance import attachments, failure, metadata
from lapwing.cosim.diagram.topic_encoder import to_record_batches
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.cosim.output_lock import write_errors
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_topics import AXES, topic_of
from lapwing.flights.log_events import event_messages
from lapwing.messages.topics import EVENTS
from lapwing.views.report import write
from lapwing.views.report.flight_phases import over
from lapwing.views.report.plot import Line, Panel, Plot, reference
from lapwing.views.report.plots.path import space

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def overview(flight: FlightData) -> Plot:
    """Plot the position with its setpoint, and the path."""
    t, desired = flight.truth.times, flight.reference
    panels = []
    for row, name in enumerate(AXES[:3]):
        marks = (
            Line(t, flight.truth.position[:, row], "flown", width=2.0),
            reference(t[: len(desired)], desired[:, row]),
        )
        panels.append(Panel(marks, f"{name} [m]", row=row))
    panels.append(space(flight)._replace(column=1, rows=3))
    return Plot(tuple(panels), "", 4.6, (1.0,) * 3, (1.35, 1.0), **over(flight))


class View:
    """Page with the 3D view of one or more flights, which works offline."""

    def __init__(self, page: str, height: int):
        """Create from the HTML text of the page and the height in a notebook [pixel]."""
        self.page, self._height = page, height

    def save(self, path: str | Path) -> Path:
        """Write the page and return its path. Raise ValueError if it cannot be written."""
        write_text(Path(path), self.page)
        return Path(path)

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{self._height}px;border:0"
        return f'<iframe title="3D view" style="{style}" srcdoc="{html.escape(self.page, quote=True)}"></iframe>'


class Flight(FlightData):
    """Recorded flight: its topics, and the outcome and metrics computed from them.

    `flight.truth.position` is an array by time, shape (n, 3) [m] in the world frame, `flight.truth.times` its times
    [s]; `flight.topic("gps/fix")` is any topic.

    Attributes:
        vehicle: name of the vehicle.
        drawn: values of the varied keys of a `campaign`, {"vehicle.mass": 10.2}; {} for another flight.
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
            with write_errors(target):
                shutil.copyfile(self.origin.source, target)
            return target
        config, messages = self.config, []
        for name in self.topics:
            topic = topic_of(name)
            messages += [(topic, time // config.interval_ns, payload) for time, payload in self.topic(name).payloads()]
        batches = to_record_batches(messages)
        last = max((int(np.max(batch.ticks)) for batch in batches), default=0)
        log_metadata = metadata(config, "memory") | (failure(self.failure, self.diverged) if self.failure else {})
        with LogWriter(target, log_metadata, attachments(config, {})) as writer:
            recording = Recording(writer, config)
            recording.write(batches, last)
            recording.finish()
            for time_ns, payload in [] if self.has("events") else event_messages(self.events):
                writer.write(EVENTS.key(self.vehicle), EVENTS.message, payload, time_ns, deterministic=False)
        return target

    def report(
        self, path: str | Path | None = None, compare_with: FlightData | None = None, view3d: bool = True
    ) -> Path:
        """Write the report: a page for a browser (.html), or its plots (.pdf, .png).

        Args:
            path: path of the report; by default .html next to the log, or SCENE.html here for a flight in memory.
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

    def view(self, compare_with: FlightData | None = None, height: int = 480) -> View:
        """Return the 3D view of the flight; a notebook shows it, `save` writes it to a page.

        Args:
            compare_with: second flight, drawn translucent beside this one.
            height: of the notebook cell [pixel].

        Raises:
            ValueError: viser is not installed.
        """
        from lapwing.views.report.sections import labels
        from lapwing.views.view3d.recording import page

        flights = self._with(compare_with)
        return View(page(flights, labels(flights)), height)

    def _with(self, other: FlightData | None) -> list[FlightData]:
        """Return this flight and the other one. Raise ValueError if the other one is not a flight."""
        if other is not None and not isinstance(other, FlightData):
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
        from lapwing.views.report.matplotlib_figure import figure, plot_style

        with plot_style():
            plot_figure = figure(overview(self))
            if path is not None:
                with write_errors(path):
                    plot_figure.savefig(path)
        return plot_figure
