"""Console for results."""

from rich.console import Console


def console(width: int | None = None) -> Console:
    """A terminal that takes text as it is: in rich's own markup "[min]" is a style, and would be swallowed.

    Args:
        width: in letters; None: the terminal's, 80 where there is none.
    """
    return Console(width=width, markup=False, highlight=False)
