"""What the user can mend ends in one line and exit code 2, a failed run in one line and exit code 1."""

import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager

import typer

USER_ERROR = 2
FLIGHT_FAILED = 4  # the scene's `run.failed` names the verdict on the flight


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn what the user can mend into one line and exit code 2, a failed run into one line and exit code 1."""
    from cosim.bus import BusError
    from cosim.interrupt import Interrupted
    from cosim.launcher import RunFailed
    from cosim.schedule import LockStepError

    try:
        yield
    except (ValueError, BusError) as error:
        fail(str(error), USER_ERROR)
    except (RunFailed, LockStepError) as error:
        fail(str(error), 1, error.__cause__)
    except Interrupted as interrupted:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        fail(str(interrupted), 128 + interrupted.signal)


def fail(message: str, code: int, cause: BaseException | None = None) -> None:
    """End with one line and an exit code; after the line, where an error in the user's own code came from."""
    typer.echo(f"lapwing: {' '.join(message.split())}", err=True)  # one line, whatever the message quotes
    if cause is not None:
        traceback.print_exception(cause)
    raise SystemExit(code)
