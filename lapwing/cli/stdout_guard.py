"""Guard of standard output: errors of a full disk or closed pipe, distinct from those of the log."""

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


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
