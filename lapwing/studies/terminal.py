"""Console for results."""

from rich.console import Console


def console(width: int | None = None) -> Console:
    """Return a console without rich's markup, which would read "[min]" as a style.

    Args:
        width: width in characters; None: that of the terminal, or 80.
    """
    return Console(width=width, markup=False, highlight=False)
