"""Ctrl-C and termination: at once where nothing is at stake, in order while a run has processes or a log."""

import signal
import sys
from contextlib import suppress
from signal import SIGINT, SIGTERM

AGAIN = 0.5  # [s] until an interruption that was lost in compiled code is raised once more


class Interrupted(BaseException):
    """The user ended the run; `signal` is how. Like KeyboardInterrupt, no `except Exception` holds it up."""

    def __init__(self, number: int):
        super().__init__(f"ended by {signal.Signals(number).name}")
        self.signal = number


class Stop:
    """Remembers SIGINT and SIGTERM while it is entered."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __enter__(self) -> "Stop":
        self._before = {n: signal.signal(n, self._note) for n in (SIGINT, SIGTERM)}
        return self

    def _note(self, number: int, _: object) -> None:
        self.number = number

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raise `Interrupted` when a signal has come."""
        if self.number is not None:
            raise Interrupted(self.number)


def end_at_once() -> None:
    """Let SIGINT and SIGTERM raise `Interrupted` wherever the program is; a flight has its gentler `Stop`."""

    def raise_(number: int, _: object) -> None:
        # An exception that is raised inside a call from the compiler's library is lost there: raise it again, later.
        signal.signal(signal.SIGALRM, lambda *_: raise_(number, None))
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
        raise Interrupted(number)

    def lost(fault: "sys.UnraisableHookArgs") -> None:
        if not isinstance(fault.exc_value, Interrupted):
            sys.__unraisablehook__(fault)

    sys.unraisablehook = lost
    for number in (SIGINT, SIGTERM):
        signal.signal(number, raise_)


def report_interrupt(interrupted: Interrupted) -> int:
    """Print the interrupt in one line and return the exit code.

    Further signals do not disturb this; later ones end a hanging process.
    """
    for number in (SIGINT, SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    with suppress(OSError):  # the exit code tells it, too
        print(f"lapwing: {interrupted}", file=sys.stderr, flush=True)
    for number in (SIGINT, SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    return 128 + interrupted.signal
