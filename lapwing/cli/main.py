"""Command line. The other modules of this package register the commands, which import their dependencies late."""

import os
import re
import resource
import sys
from contextlib import AbstractContextManager, nullcontext
from typing import Annotated

import typer

from lapwing.cli import (  # noqa: F401 (they register themselves)
    campaign_commands,
    export_commands,
    feed_command,
    flight_commands,
    log_commands,
    log_playback,
    new_command,
    new_vehicle,
    report_commands,
    run_command,
    scene_commands,
    scene_tests,
    service_commands,
    study_commands,
)
from lapwing.cli.app import GROUPS, app
from lapwing.cli.error_exit import USER_ERROR, check_output, fail, user_errors

# Raised for unknown options and missing arguments; not every version of typer exports the class.
UsageError: type[typer.BadParameter] = typer.BadParameter.__base__  # type: ignore[assignment]
REWORDED = {  # messages of typer
    r"^Missing (?:argument|option) '(.+)'\.$": r"\1: missing",
    r"^Missing command\.$": "COMMAND: missing",
    r"^No such command '(.+?)'\.": r"\1: unknown command",
    r"^No such option: (\S+)": r"\1: unknown option",
    r" (?:Did you mean '(.+)'\?|\(Possible options: (.+)\)|Did you mean (--\S+)\?)$": r"; did you mean \1\2\3?",
    r"^Got unexpected extra arguments?(?:\(s\))? \((.+)\)$": r"\1: unexpected argument",
    r"^Option '(.+)' requires an argument\.$": r"\1: expected a value",
    r"^Option '(.+)' does not take a value\.$": r"\1: takes no value",
}
FEWEST_FILES = 64  # open files; a run with several processes needs about 30


def _check_working_directory() -> None:
    try:
        os.getcwd()
    except OSError:
        raise ValueError("working directory: does not exist; change to another folder") from None


def _check_encoding() -> None:
    """Raise ValueError for a name that logs and pages cannot contain, before the flight and not after it."""
    for what, text in (("working directory", os.getcwd()), *(("argument", each) for each in sys.argv[1:])):
        try:
            text.encode()
        except UnicodeEncodeError:
            encoding = sys.getfilesystemencoding()
            shown = text.encode("ascii", "backslashreplace").decode()
            raise ValueError(
                f"{what} {shown}: not valid {encoding}; use another name, or a UTF-8 locale (LC_ALL=C.UTF-8)"
            ) from None


def _check_open_files() -> None:
    """Raise ValueError if the limit of open files is so low that libraries would end the process."""
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if 0 <= limit < FEWEST_FILES:
        raise ValueError(f"too many open files: at most {limit} are allowed; use ulimit -n 1024")


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
    from lapwing.cosim.processes.interrupt import interrupts_first

    with user_errors(), interrupts_first(), check_output():
        _check_working_directory()
        _check_encoding()
        _check_open_files()
        from lapwing.cosim.processes import relax_gc
        from lapwing.services.common import foreign_code

        relax_gc()
        try:
            with foreign_code.permission(False), _watchdog(sys.argv[1:]):
                app(sys.argv[1:] or ["--help"], prog_name="lapwing", standalone_mode=False)
        except UsageError as error:
            command = error.ctx.command_path if error.ctx else " ".join(["lapwing", *_command_name()])
            fail(f"{_usage_text(error)} (see {command} --help)", USER_ERROR)


# A campaign has its own, which starts after the checks of its options: numba takes half a second to import.
WATCHED = {*GROUPS["Study"], "check", "precompile", "resimulate", "test", "tune", "validate"}


def _watchdog(arguments: list[str]) -> AbstractContextManager:
    """Return a watchdog for a command that computes in compiled code; a run has its own."""
    if arguments[:1] and arguments[0] in WATCHED and "--help" not in arguments:
        from lapwing.cosim.processes.watchdog import Watchdog

        return Watchdog()
    return nullcontext()


def _command_name() -> list[str]:
    """Return the first argument in a list if it is not an option."""
    return [text for text in sys.argv[1:2] if not text.startswith("-")]


def _usage_text(error: typer.BadParameter) -> str:
    """Return the fault of a command line in the style of other errors, with the value that typer leaves out."""
    details: list = getattr(error.__cause__, "errors", list)()  # of pydantic, in newer versions of typer
    parameter = getattr(error, "param", None)
    if not details or parameter is None or details[0]["type"] == "value_error":
        text = error.format_message()
        for pattern, replacement in REWORDED.items():
            text = re.sub(pattern, replacement, text)
        return text
    name = parameter.opts[0] if parameter.opts[0].startswith("-") else str(parameter.metavar or parameter.name)
    expected = details[0]["msg"].removeprefix("Input should be ").partition(", unable to parse")[0]
    number = "a number " if expected.startswith(("less", "greater")) else ""
    return f"{name} {details[0]['input']}: expected {number}{expected}"


if __name__ == "__main__":
    main()
