"""Single keys from a terminal, while something else goes on."""

import os
import select
from typing import Any


class Keyboard:
    """A context manager in which a terminal hands over each key at once and shows none; elsewhere there are no keys."""

    def __init__(self, descriptor: int = 0):
        """Of a file descriptor, by default standard input."""
        self._descriptor = descriptor
        self._before: Any = None
        self.there = os.isatty(descriptor) and _in_foreground(descriptor)

    def keys(self) -> str:
        """What has been typed since the call before."""
        if not self.there or not select.select([self._descriptor], [], [], 0.0)[0]:
            return ""
        typed = os.read(self._descriptor, 64)
        self.there = bool(typed)  # else the terminal is gone
        return typed.decode(errors="replace")

    def __enter__(self) -> "Keyboard":
        if self.there:
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
    """Whether a terminal's keys are this process's: a job in the background would be stopped if it took them."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:  # not the terminal that controls this process
        return True
