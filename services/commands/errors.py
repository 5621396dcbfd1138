"""What the user can mend ends in one line and exit code 2, a failed run in one line and exit code 1."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

import typer

USER_ERROR = 2


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn what the user can mend into one line and exit code 2, a failed run into one line and exit code 1."""
    from services.bus import BusError
    from services.flight import Interrupted
    from services.launcher import RunFailed
    from services.lockstep import LockStepError

    try:
        yield
    except (ValueError, BusError) as error:
        fail(str(error), USER_ERROR)
    except (RunFailed, LockStepError) as error:
        fail(str(error), 1)
    except Interrupted as interrupted:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        fail(str(interrupted), 128 + interrupted.signal)


def fail(message: str, code: int) -> None:
    """End with one line and an exit code."""
    typer.echo(f"lapwing: {' '.join(message.split())}", err=True)  # one line, whatever the message quotes
    raise SystemExit(code)
