"""Single key presses from a terminal."""

import os
import select
from typing import Any


class Keyboard:
    """Context manager that reads single keys of a terminal without echo; other inputs have no keys."""

    def __init__(self, descriptor: int = 0):
        """Read keys of a file descriptor, by default standard input."""
        self._descriptor = descriptor
        self._before: Any = None
        self.available = os.isatty(descriptor) and _in_foreground(descriptor)

    def keys(self) -> str:
        """Return the keys that were typed since the last call."""
        if not self.available or not select.select([self._descriptor], [], [], 0.0)[0]:
            return ""
        typed = os.read(self._descriptor, 64)
        self.available = bool(typed)  # empty if the terminal was closed
        return typed.decode(errors="replace")

    def __enter__(self) -> "Keyboard":
        if self.available:
            import termios
            import tty

            self._before = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            import termios

            termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)


def _in_foreground(descriptor: int) -> bool:
    """Return True if this process owns the terminal: a background job would be stopped when it reads from it."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:  # not the terminal that controls this process
        return True
