"""Ctrl-C, SIGTERM and a closed terminal: a run ends in order, other commands end immediately."""

import signal
import sys
from contextlib import suppress
from signal import SIGHUP, SIGINT, SIGTERM

# nohup ignores SIGHUP, which a closed terminal sends
ENDING = (SIGINT, SIGTERM) if signal.getsignal(SIGHUP) == signal.SIG_IGN else (SIGINT, SIGTERM, SIGHUP)
REPEAT_DELAY = 0.5  # [s] until an interrupt that was lost in compiled code is raised again


class Interrupted(BaseException):
    """The user ended the program by `signal`. Like KeyboardInterrupt, it is not an Exception."""

    def __init__(self, number: int):
        super().__init__(f"ended by {signal.Signals(number).name}")
        self.signal = number


def interrupt_behind(error: BaseException) -> Interrupted | None:
    """Return the interrupt that caused an error, or None.

    Python 3.11 raises RuntimeError from an exception in `__set_name__`, which every dataclass calls at its definition.
    """
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, Interrupted):
        cause = cause.__cause__ or cause.__context__
    return cause


class Stop:
    """Context in which the signals of `ENDING` are stored instead of raised."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __enter__(self) -> "Stop":
        self._before = {n: signal.signal(n, self._note) for n in ENDING}
        return self

    def _note(self, number: int, _: object) -> None:
        self.number = number

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raise `Interrupted` if a signal was received."""
        if self.number is not None:
            raise Interrupted(self.number)


def raise_on_interrupt() -> None:
    """Let the signals of `ENDING` raise `Interrupted` immediately; a run uses `Stop` instead."""

    raised = False

    def raise_(number: int, _: object) -> None:
        nonlocal raised
        raised = True
        # An exception that is raised inside a call from the compiler's library is lost there: raise it again, later.
        signal.signal(signal.SIGALRM, lambda *_: raise_(number, None))
        signal.setitimer(signal.ITIMER_REAL, REPEAT_DELAY)
        raise Interrupted(number)

    def report_unraisable(unraisable: "sys.UnraisableHookArgs") -> None:
        # An interrupt leaves objects whose constructor has not finished; their `__del__` may fail.
        if not raised:
            sys.__unraisablehook__(unraisable)

    sys.unraisablehook = report_unraisable
    for number in ENDING:
        signal.signal(number, raise_)


def report_interrupt(interrupted: Interrupted) -> int:
    """Print the interrupt in one line and return the exit code.

    Signals are ignored until the line is printed; later ones end a hanging process.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    with suppress(OSError):  # the exit code also reports it
        print(f"lapwing: {interrupted}", file=sys.stderr, flush=True)
    for number in ENDING:
        signal.signal(number, signal.SIG_DFL)
    return 128 + interrupted.signal
