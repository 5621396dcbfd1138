"""Report on paper: A4 pages with title, outcome, table of errors and facts, then the plots, as PDF."""

import textwrap
from collections.abc import Iterable, Sequence
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib import rc_context
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from lapwing.views.report.key_numbers import KeyNumber
from lapwing.views.report.matplotlib_figure import draw_plot, plot_style, show_dollars
from lapwing.views.report.plot import Plot
from lapwing.views.report.style import BOUND, QUIET, TEXT, WIDTH

PAGE = (8.27, 11.69)  # [inch] A4
MARGIN = 0.6  # [inch]
INNER = (PAGE[0] - 2.0 * MARGIN, PAGE[1] - 2.0 * MARGIN - 0.2)  # [inch] area without margins and page number
SCALE = INNER[0] / WIDTH  # scale of a plot's height
HEADING = 0.35  # [inch] height of a plot's title
FONT = 7.5  # [point] font size in plots
LETTERS = 110  # characters in a line of text


class Cover(NamedTuple):
    """Text of the first page."""

    title: str
    lead: str
    outcomes: tuple[str, ...]
    columns: tuple[str, ...] = ()  # headers of the table; the first column has the names of the rows
    rows: tuple[tuple[str, ...], ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    numbers: tuple[tuple[str, KeyNumber], ...] = ()  # with their labels


class Titled(NamedTuple):
    """A plot with its title."""

    title: str
    plot: Plot


def write_pdf(path: Path, cover: Cover, plots: Iterable[Titled]) -> None:
    """Write the cover, then as many plots per page as fit, on numbered pages of equal size."""
    packed, document = _paginate(plots), BytesIO()  # PdfPages cannot be closed on a full disk
    with (
        plot_style(),
        rc_context({"font.size": FONT, "axes.titlesize": FONT}),
        PdfPages(document, metadata={"Title": cover.title, "CreationDate": None}) as out,
    ):
        for number, sheet in enumerate(chain([_cover(cover)], map(_page, packed)), 1):
            text = f"{cover.title} · page {number} of {1 + len(packed)}"
            sheet.text(1.0 - MARGIN / PAGE[0], 0.5 * MARGIN / PAGE[1], text, ha="right", fontsize=7, color=QUIET)
            show_dollars(sheet)
            out.savefig(sheet)
    path.write_bytes(document.getvalue())


def _paginate(plots: Iterable[Titled]) -> list[list[Titled]]:
    """Return the plots of each page."""
    pages: list[list[Titled]] = []
    free = 0.0
    for titled in plots:
        needed = min(_height(titled), INNER[1])
        if needed > free:
            pages.append([])
            free = INNER[1]
        pages[-1].append(titled)
        free -= needed
    return pages


def _height(titled: Titled) -> float:
    """Return the height of a plot on the page with its title and caption [inch]."""
    return HEADING + titled.plot.height * SCALE + 0.15 + 0.14 * len(_wrap(titled.plot.caption))


def _page(plots: Sequence[Titled]) -> Figure:
    heights = [min(_height(titled), INNER[1]) for titled in plots]
    rest = max(INNER[1] - sum(heights), 0.01)
    left, bottom = MARGIN / PAGE[0], (MARGIN + 0.2) / PAGE[1]
    layout = ConstrainedLayoutEngine(rect=(left, bottom, INNER[0] / PAGE[0], INNER[1] / PAGE[1]))
    figure = Figure(figsize=PAGE, layout=layout)
    ratios = [ratio for height in heights for ratio in (HEADING, height - HEADING)]
    parts: Any = figure.subfigures(len(ratios) + 1, 1, height_ratios=[*ratios, rest])
    for titled, heading, part in zip(plots, parts[0::2], parts[1::2], strict=False):
        heading.text(0.01, 0.1, titled.title, va="bottom", fontsize=10, fontweight="bold", color=TEXT)
        caption = "\n".join(_wrap(titled.plot.caption))
        part.supxlabel(caption, x=0.01, ha="left", fontsize=7, color="#555555")
        draw_plot(titled.plot, part)
    return figure


def _cover(cover: Cover) -> Figure:
    """Return the first page."""
    figure = Figure(figsize=PAGE)
    left, line = MARGIN / PAGE[0], 0.19 / PAGE[1]
    y = 1.0 - MARGIN / PAGE[1]

    def write(text: str, size: float, **looks: Any) -> None:
        nonlocal y
        for part in textwrap.wrap(text, int(LETTERS * 8.0 / size)) or [""]:
            figure.text(left, y, part, va="top", fontsize=size, **{"color": TEXT, **looks})
            y -= line * size / 8.0

    write(cover.title, 18, fontweight="bold")
    write(cover.lead, 9, color="#555555")
    y -= line
    for outcome in cover.outcomes:
        write(outcome, 11)
    y -= 0.4 * line
    for label, number in cover.numbers:
        figure.text(left, y - 0.1 * line, label, va="top", fontsize=9, color="#555555")
        value = number.text
        figure.text(left + 0.33, y, value, va="top", fontsize=11, fontweight="bold", color=TEXT)
        colour = BOUND if number.mark in ("warn", "bad") else "#555555"
        figure.text(left + 0.46, y - 0.1 * line, number.comparison, va="top", fontsize=9, color=colour)
        y -= 1.5 * line
    if cover.rows:
        y -= line
        for k, row in enumerate((cover.columns, *cover.rows)):
            weight = "bold" if k == 0 else "normal"
            for column, text in enumerate(row):
                x = left + (0.0 if column == 0 else 0.12 + 0.16 * column)
                looks: dict[str, Any] = {"ha": "left" if column == 0 else "right", "va": "top", "fontweight": weight}
                figure.text(x, y, text, fontsize=9, color=TEXT, **looks)
            y -= 1.15 * line
    if cover.facts:
        y -= line
        for name, value in cover.facts:
            figure.text(left, y, name, va="top", fontsize=8, color="#555555")
            for part in textwrap.wrap(value, LETTERS - 22) or [""]:
                figure.text(left + 0.17, y, part, va="top", fontsize=8, color=TEXT)
                y -= line
    return figure


def _wrap(text: str) -> list[str]:
    return textwrap.wrap(text, int(LETTERS * 8.0 / 7.0))
