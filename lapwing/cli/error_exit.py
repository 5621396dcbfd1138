"""Exit codes, errors as one line on standard error, and errors of a standard output that cannot be written."""

import io
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import typer

from lapwing.cli.output_paths import release_claims

USER_ERROR = 2
DIFFERENT = 3  # two logs, or a digest or final state and its record, differ
FLIGHT_FAILED = 4  # a criterion of the scene's `success.require` is not met


def _option_of(key: str) -> str:
    """Return "--set" if the user has given the key with it; "" for a key that another option overrides."""
    typed = (text.removeprefix("--set=").partition("=")[0].strip() for text in sys.argv[1:])
    return "--set" if key in typed else ""


@contextmanager
def user_errors() -> Iterator[None]:
    """Print errors as one line; exit with 2 for invalid input, with 1 for a failed run or a system error."""
    from lapwing.cosim.optional_packages import missing_in
    from lapwing.cosim.run_errors import BusError, LockStepError, RunFailed
    from lapwing.cosim.scene import SceneError

    try:
        yield
    except SceneError as error:
        fail(str(error.with_option(_option_of)), USER_ERROR)
    except (ValueError, BusError) as error:
        fail(str(error), USER_ERROR)
    except (RunFailed, LockStepError) as error:
        fail(str(error), 1, _cause(error))
    except OutputError as error:
        if error.closed:  # end like a program that receives SIGPIPE
            raise SystemExit(128 + signal.SIGPIPE) from None
        fail(str(error), 1)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        fail(f"{error.filename or 'system'}: {reason}", 1)
    except MemoryError:
        fail("system: not enough memory", 1)
    except ImportError as error:
        if message := missing_in(error):
            fail(message, USER_ERROR)
        if "failed to map segment" not in str(error):  # ld.so has no room for a native library
            raise
        fail("system: not enough memory", 1)
    finally:
        release_claims()


def _cause(error: BaseException) -> BaseException | None:
    """Return the exception that caused `error`, None if there is none."""
    cause = error.__cause__
    # A pool of workers adds its own traceback as the cause, with the text of the causes before it.
    if type(cause).__name__ == "_RemoteTraceback" and "the direct cause of" not in str(cause):
        return None
    return cause


def fail(message: str, code: int, cause: BaseException | None = None) -> None:
    """Exit with one line on standard error, followed by the traceback of an error in user code."""
    with suppress(OSError):  # standard error may be full
        typer.echo(f"lapwing: {' '.join(message.split())}", err=True)
        if cause is not None:
            traceback.print_exception(cause)
    raise SystemExit(code)


class OutputError(Exception):
    """Standard output cannot be written.

    Attributes:
        closed: its reader has exited, as in `lapwing ... | head`.
    """

    def __init__(self, error: OSError):
        super().__init__(f"standard output: cannot be written: {(error.strerror or str(error)).lower()}")
        self.closed = isinstance(error, BrokenPipeError)


class _Raw(io.FileIO):
    _lost = False

    def write(self, data: Any) -> int:
        """Write. Raise OutputError at the first failure, and discard all later data."""
        if self._lost:
            return len(data)
        try:
            return super().write(data) or 0
        except OSError as error:
            self._lost = True
            raise OutputError(error) from None


@contextmanager
def check_output() -> Iterator[None]:
    """Let standard output raise `OutputError` if it cannot be written, at the latest at the end of the context."""
    before = sys.stdout
    try:
        raw = _Raw(before.fileno(), "w", closefd=False)
    except (AttributeError, OSError):  # no standard output, or not a file
        yield
        return
    before.flush()
    sys.stdout = io.TextIOWrapper(
        io.BufferedWriter(raw),
        before.encoding,
        before.errors,
        line_buffering=bool(before.line_buffering),
        write_through=bool(getattr(before, "write_through", False)),
    )
    try:
        yield
    except BaseException:  # the first error is reported, not that of the output
        with suppress(OutputError):
            sys.stdout.flush()
        raise
    else:
        sys.stdout.flush()
    finally:
        sys.stdout = before
