"""The results as one HTML page that needs nothing else."""

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader

from lapwing.studies.stability.case_runner import Result
from lapwing.studies.stability.chart import chart
from lapwing.studies.stability.console_output import distance, figure, verdict

_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent), autoescape=True, trim_blocks=True, lstrip_blocks=True
)


def write(path: Path, results: Sequence[Result]) -> None:
    """Write the page.

    Raises:
        ValueError: it cannot be written.
    """
    text = _TEMPLATES.get_template("page.html").render(
        results=results, chart=chart, figure=figure, verdict=verdict, distance=distance
    )
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as fault:
        raise ValueError(f"{path}: cannot write the page: {fault.strerror or fault}") from None
