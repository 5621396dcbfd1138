"""Result of a study: verdict, tables and plots, rendered here for the terminal, as JSON, page, PDF and image."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.output_lock import write_errors
from lapwing.studies import json_file
from lapwing.views.report.plot import NotRecordedError, Plot
from lapwing.views.report.sections import Section
from lapwing.views.terminal import COMPACT, table

STYLES = {"good": "bold green", "warn": "bold yellow", "bad": "bold red", "": "bold"}  # of a verdict by its mark
COVER_COLUMNS = 5  # of the first table, on the cover of a PDF


class Rows:
    """Table of texts with title, column heads and rows; the first cell of a row is its name."""

    def __init__(self, title: str, *heads: str, caption: str = "", texts: tuple[str, ...] = (), only: str = ""):
        """Create an empty table; `texts` are heads of left-aligned columns, `only` is "console", "page" or "": both."""
        self.title, self.heads, self.caption, self.texts, self.only = title, heads, caption, texts, only
        self.rows: list[tuple[str, ...]] = []
        self.failed: set[int] = set()  # indices of rows with a failure

    def add(self, *cells: str, failed: bool = False) -> None:
        """Add a row."""
        if failed:
            self.failed.add(len(self.rows))
        self.rows.append(cells)


class StudyResult(NamedTuple):
    """Findings of a study, in the order in which a reader needs them."""

    title: str
    verdict: str  # one sentence
    mark: str = ""  # "good", "warn" or "bad"
    lead: tuple[str, ...] = ()  # lines on the verdict
    tables: tuple[Rows, ...] = ()  # on a page, the first one stands before the plots
    plots: Mapping[str, Callable[[], Plot]] = {}  # by title; may raise NotRecordedError
    notes: tuple[str, ...] = ()  # lines below the tables
    facts: Mapping[str, str] = {}  # what the study was made with; on pages
    data: Mapping[str, Any] = {}  # content of the JSON file, besides title, verdict and mark


def show(console: Console, result: StudyResult) -> None:
    """Print the verdict, then lines and tables."""
    console.print(f"{result.title}: {result.verdict}", style=STYLES[result.mark], soft_wrap=True)
    for line in result.lead:
        console.print(f"  {line}", soft_wrap=True)
    for rows in result.tables:
        if rows.only == "page" or not rows.rows:
            continue
        shown = table(*rows.heads, title=rows.title, **COMPACT)
        for head, column in zip(rows.heads, shown.columns, strict=True):
            column.justify = "left" if head in (rows.heads[0], *rows.texts) else "right"
            column.no_wrap = head not in rows.texts
        grouped = any(a[0] == b[0] for a, b in pairwise(rows.rows))  # rows of one name belong together
        for k, row in enumerate(rows.rows):
            ends = grouped and k + 1 < len(rows.rows) and rows.rows[k + 1][0] != row[0]
            shown.add_row(*row, style="bold red" if k in rows.failed else None, end_section=ends)
        console.print(shown)
    for line in result.notes:
        console.print(line, soft_wrap=True)


def write_json(path: Path, result: StudyResult) -> None:
    """Write the verdict and the data of the study; infinite and unknown values are null."""
    json_file.write_json(path, {"title": result.title, "verdict": result.verdict, "mark": result.mark, **result.data})


def write_report(path: Path, result: StudyResult) -> None:
    """Write the report in the format of the suffix: .html, .pdf or .png.

    Raises:
        ValueError: the file cannot be written.
    """
    sections = [_section(title, draw) for title, draw in result.plots.items()]
    with write_errors(path), complete_file(path) as file:
        if path.suffix == ".html":
            from lapwing.views.report.page import render  # imports a package of the extra `report`, as those below

            file.write_text(render("study.html", sections, result=result), encoding="utf-8")
            return
        from lapwing.views.report.matplotlib_figure import write_png
        from lapwing.views.report.paper import Cover, Titled, write_pdf

        drawn = [Titled(section.title, section.plot) for section in sections if section.plot]
        if path.suffix == ".png":
            write_png(file, [titled.plot for titled in drawn])
            return
        first = result.tables[0] if result.tables else Rows("")
        rows = tuple(row[:COVER_COLUMNS] for row in first.rows)
        facts = tuple(result.facts.items())
        cover = Cover(result.title, " ".join(result.lead), (result.verdict,), first.heads[:COVER_COLUMNS], rows, facts)
        write_pdf(file, cover, drawn)


def write_plot(path: Path, result: StudyResult) -> None:
    """Write the first plot in the format of the suffix: .png, .svg or .pdf."""
    from lapwing.views.report.matplotlib_figure import figure, plot_style

    with plot_style():
        figure(next(iter(result.plots.values()))()).savefig(path)


def _section(title: str, draw: Callable[[], Plot]) -> Section:
    name = title.lower().replace(" ", "-")
    try:
        return Section(name, title, draw())
    except NotRecordedError as reason:
        return Section(name, title, missing=str(reason))
