"""Writes a report in the format of the file's ending."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from lapwing.studies.flight_data import FlightData

FORMATS = (".html", ".pdf", ".png")


def write(flights: FlightData | Sequence[FlightData], target: Path) -> Path:
    """Write the report of a flight, or of two laid over each other; its path.

    A name that ends in .html gives a page for a browser; .pdf a page a plot, .png all of them in one picture.

    Raises:
        ValueError: the report cannot be written, or the file's name has another ending.
    """
    flown = [flights] if isinstance(flights, FlightData) else list(flights)
    check_format(target)
    try:
        if target.suffix == ".html":
            from lapwing.studies.report.page import flight_page

            target.write_text(flight_page(flown), encoding="utf-8")
        else:
            from lapwing.studies.report.matplotlib_figure import write_pdf, write_png
            from lapwing.studies.report.sections import sections

            draw = write_pdf if target.suffix == ".pdf" else write_png
            draw(target, [section.plot for section in sections(flown) if section.plot])
    except OSError as fault:
        with suppress(OSError):
            target.unlink(missing_ok=True)  # no half of one
        raise ValueError(f"{target}: cannot write the report: {fault.strerror or fault}") from None
    return target


def check_format(target: Path) -> None:
    """Refuse a name with an ending that no report has.

    Raises:
        ValueError: it has another.
    """
    if target.suffix not in FORMATS:
        raise ValueError(f"{target}: expected a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
