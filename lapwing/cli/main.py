"""The command line. The other modules of this package register the commands, which import what they need."""

import os
import sys
from typing import Annotated

import typer

from lapwing.cli import (  # noqa: F401 (they register themselves)
    campaign_commands,
    certificates_command,
    flight_commands,
    log_commands,
    log_playback,
    new_command,
    new_vehicle,
    protocol,
    run_command,
    scene_commands,
    schema_command,
    service_command,
    study_commands,
)
from lapwing.cli.app import app
from lapwing.cli.error_exit import USER_ERROR, fail, user_errors
from lapwing.cli.stdout_guard import checked_output

# Raised for unknown options and missing arguments; not every version of typer exports the class.
UsageError: type[typer.BadParameter] = typer.BadParameter.__base__  # type: ignore[assignment]


def _check_working_directory() -> None:
    try:
        os.getcwd()
    except OSError:
        raise ValueError("working directory: does not exist; change to another folder") from None


def _show_version(requested: bool) -> None:
    if requested:
        from lapwing.cosim.config.provenance import package_version

        typer.echo(f"lapwing {package_version()}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="show the version and exit")
    ] = False,
) -> None:
    """Co-simulation of multirotors in lock step over Zenoh, recorded to MCAP."""


def main() -> None:
    """Run the command of the command line."""
    with user_errors(), checked_output():
        _check_working_directory()
        from lapwing.cosim.processes.gc_tuning import leave_garbage

        leave_garbage()
        try:
            app(sys.argv[1:] or ["--help"], standalone_mode=False)
        except UsageError as error:
            fail(f"{error.format_message()} (see lapwing --help)", USER_ERROR)


if __name__ == "__main__":
    main()
