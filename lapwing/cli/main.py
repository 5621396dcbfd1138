"""`lapwing`: the entry point. The commands are in services/commands, the one place that knows services and studies.

Modules are imported where they are used, so that a service's process starts quickly.
"""

import sys
from typing import Annotated

import typer

from lapwing.cli import again, docs, look, new, protocol, run, serve, studies  # noqa: F401 (they register themselves)
from lapwing.cli.app import app
from lapwing.cli.errors import USER_ERROR, fail, user_errors

# Of unknown options and missing arguments; not every version of typer exports the class itself.
UsageError: type[typer.BadParameter] = typer.BadParameter.__base__  # type: ignore[assignment]


def _show_version(wanted: bool) -> None:
    from cosim.provenance import package_version

    if wanted:
        typer.echo(f"lapwing {package_version()}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="show the version and end")
    ] = False,
) -> None:
    """Co-simulation of multirotors in lock step over Zenoh, recorded to MCAP."""


def main() -> None:
    """Entry point of `lapwing`."""
    with user_errors():
        from cosim.interrupt import end_at_once

        end_at_once()
        try:
            app(sys.argv[1:] or ["--help"], standalone_mode=False)
        except UsageError as error:
            fail(f"{error.format_message()} (see lapwing --help)", USER_ERROR)


if __name__ == "__main__":
    main()
