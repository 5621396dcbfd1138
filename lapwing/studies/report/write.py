"""Output of a report in the format of the file name's extension."""

from collections.abc import Sequence
from pathlib import Path

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.output_lock import write_errors
from lapwing.studies.flight_data import FlightData

FORMATS = (".html", ".pdf", ".png")


def write(flights: FlightData | Sequence[FlightData], target: Path, view3d: bool = False) -> Path:
    """Write the report of a flight, or of an overlay of two; return its path.

    Args:
        flights: one or two flights.
        target: .html for a page in a browser, .pdf with a cover and numbered A4 pages, .png with all plots.
        view3d: True to include the 3D view in the page, if viser is installed.

    Raises:
        ValueError: the report cannot be written, or the file name has another extension.
    """
    flight_list = [flights] if isinstance(flights, FlightData) else list(flights)
    check_format(target)
    with write_errors(target), complete_file(target) as file:
        if target.suffix == ".html":
            from lapwing.studies.report.page import flight_page
            from lapwing.studies.view3d import available

            located = all(flight.located for flight in flight_list)
            file.write_text(flight_page(flight_list, view3d and available() and located), encoding="utf-8")
        else:
            from lapwing.studies.report.sections import sections

            drawable = (section for section in sections(flight_list) if section.plot)
            if target.suffix == ".pdf":
                from lapwing.studies.report.flight_cover import cover
                from lapwing.studies.report.paper import Titled, write_pdf

                write_pdf(file, cover(flight_list), [Titled(s.title, s.plot) for s in drawable if s.plot])
            else:
                from lapwing.studies.report.matplotlib_figure import write_png

                write_png(file, [s.plot for s in drawable if s.plot])
    return target


def check_format(target: Path) -> None:
    """Check the extension of a report's file name.

    Raises:
        ValueError: the format is unknown.
    """
    if target.suffix not in FORMATS:
        raise ValueError(f"{target}: expected a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
