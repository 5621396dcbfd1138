"""Console and tables for results."""

from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

COMPACT: dict[str, Any] = {"box": SIMPLE, "pad_edge": False, "collapse_padding": True}  # for tables of up to 80 columns


def console(width: int | None = None) -> Console:
    """Return a console without rich's markup, which would read "[min]" as a style.

    Args:
        width: width in characters; None: that of the terminal, or 80.
    """
    return Console(width=width, markup=False, highlight=False)


def table(first: str, *others: str, **options: Any) -> Table:
    """Return a table with a column of texts, and right-aligned columns of numbers; `options` are those of rich."""
    result = Table(title_justify="left", **options)
    result.add_column(first, no_wrap=True)
    for head in others:
        result.add_column(head, justify="right", no_wrap=True)
    return result


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: "1 flight", "2 flights"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
