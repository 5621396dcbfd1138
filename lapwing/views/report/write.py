"""Output of a report in the format of the file name's extension."""

from collections.abc import Sequence
from pathlib import Path

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.optional_packages import missing
from lapwing.cosim.output_lock import write_errors
from lapwing.flights.flight_data import FlightData

PACKAGES = {".html": ("jinja2", "plotly"), ".pdf": ("matplotlib",), ".png": ("matplotlib",)}  # of the extra `report`
FORMATS = tuple(PACKAGES)


def write(flights: FlightData | Sequence[FlightData], target: Path, view3d: bool = False) -> Path:
    """Write the report of a flight, or of an overlay of two; return its path.

    Args:
        flights: one or two flights.
        target: .html for a page in a browser, .pdf with a cover and numbered A4 pages, .png with all plots.
        view3d: True to include the 3D view in the page, if viser is installed.

    Raises:
        ValueError: the report cannot be written, a package is missing, or the file name has another extension.
    """
    flight_list = [flights] if isinstance(flights, FlightData) else list(flights)
    check_format(target)
    if message := unavailable(target.suffix):
        raise ValueError(f"{target}: {message}")
    with write_errors(target), complete_file(target) as file:
        if target.suffix == ".html":
            from lapwing.views.report.page import flight_page
            from lapwing.views.view3d import available

            located = all(flight.located for flight in flight_list)
            file.write_text(flight_page(flight_list, view3d and available() and located), encoding="utf-8")
        else:
            from lapwing.views.report.sections import sections

            drawable = (section for section in sections(flight_list) if section.plot)
            if target.suffix == ".pdf":
                from lapwing.views.report.flight_cover import cover
                from lapwing.views.report.paper import Titled, write_pdf

                write_pdf(file, cover(flight_list), [Titled(s.title, s.plot) for s in drawable if s.plot])
            else:
                from lapwing.views.report.matplotlib_figure import write_png

                write_png(file, [s.plot for s in drawable if s.plot])
    return target


def unavailable(suffix: str = ".html") -> str:
    """Return the package that reports of this format lack and the command that installs it; "" if there is none."""
    return missing(*PACKAGES[suffix])


def check_format(target: Path) -> None:
    """Check the extension of a report's file name.

    Raises:
        ValueError: the format is unknown.
    """
    if target.suffix not in FORMATS:
        raise ValueError(f"{target}: expected a name that ends in {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
