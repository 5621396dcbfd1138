"""What the user can mend ends in one line and exit code 2, a failed run in one line and exit code 1."""

import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import typer

from lapwing.cli.output_paths import release_claims
from lapwing.cli.stdout_guard import OutputError

USER_ERROR = 2
DIFFERENT = 3  # two logs, or a log and its digest, do not agree
FLIGHT_FAILED = 4  # an expression of the scene's `success.require` does not hold


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn what the user can mend into one line and exit code 2, a failed run into one line and exit code 1."""
    from lapwing.cosim.run_errors import BusError, LockStepError, RunFailed

    try:
        yield
    except (ValueError, BusError) as error:
        fail(str(error), USER_ERROR)
    except (RunFailed, LockStepError) as error:
        fail(str(error), 1, error.__cause__)
    except OutputError as error:
        if error.closed:  # nobody reads any more: end as any program does that is sent SIGPIPE
            raise SystemExit(128 + signal.SIGPIPE) from None
        fail(str(error), 1)
    finally:
        release_claims()


def fail(message: str, code: int, cause: BaseException | None = None) -> None:
    """End with one line and an exit code; after the line, where an error in the user's own code came from."""
    with suppress(OSError):  # the exit code tells it, too
        typer.echo(f"lapwing: {' '.join(message.split())}", err=True)  # one line, whatever the message quotes
        if cause is not None:
            traceback.print_exception(cause)
    raise SystemExit(code)
