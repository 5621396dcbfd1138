"""Console for results."""

from rich.console import Console


def console(width: int | None = None) -> Console:
    """Return a terminal without rich's markup, in which "[min]" would be a style.

    Args:
        width: in letters; None: the terminal's, 80 without one.
    """
    return Console(width=width, markup=False, highlight=False)
