"""Command line of a benchmark."""

import sys
from collections.abc import Callable
from typing import Any

import typer


def command_line(main: Callable[..., Any]) -> None:
    """Call the `main` of a benchmark with options by its parameters and the docstring of its module as help."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    text = sys.modules[main.__module__].__doc__ or ""
    app.command(help="\b\n" + text.replace("\n\n", "\n\n\b\n"))(main)
    app(prog_name=f"python -m {sys.modules['__main__'].__spec__.name.removesuffix('.__main__')}")
