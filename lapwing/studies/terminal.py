"""Console and tables for results."""

from typing import Any

from rich.console import Console
from rich.table import Table


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
