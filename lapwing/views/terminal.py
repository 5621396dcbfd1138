"""Console and tables for results."""

import os
import sys
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

COMPACT: dict[str, Any] = {"box": SIMPLE, "pad_edge": False, "collapse_padding": True}  # for tables of up to 80 columns


def console(piped: int = 80) -> Console:
    """Return a console without rich's markup, which would read "[min]" as a style.

    Args:
        piped: width in characters where the output is no terminal, unless the user sets COLUMNS.
    """
    width = None if sys.stdout.isatty() or "COLUMNS" in os.environ else piped
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
