"""Ctrl-C, SIGTERM and a closed terminal: a run ends in order, other commands end immediately."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from signal import SIGHUP, SIGINT, SIGTERM

from lapwing.cosim.processes.patience import Patience

# nohup ignores SIGHUP, which a closed terminal sends
ENDING = (SIGINT, SIGTERM) if signal.getsignal(SIGHUP) == signal.SIG_IGN else (SIGINT, SIGTERM, SIGHUP)
BLOCK_LIMIT = 1.0  # [s] from a signal until the Python block that still runs is interrupted
REPEAT_DELAY = 0.5  # [s] until an interrupt that was lost in compiled code is raised again


class Interrupted(BaseException):
    """The user ended the program by `signal`. Like KeyboardInterrupt, it is not an Exception."""

    def __init__(self, number: int, detail: str = ""):
        super().__init__("; ".join(filter(None, [f"ended by {signal.Signals(number).name}", detail])))
        self.signal = number


_raised: Interrupted | None = None  # the first that `raise_on_interrupt` has raised


@contextmanager
def interrupts_first() -> Iterator[None]:
    """Raise the interrupt instead of an error that follows from it.

    An interrupt that is lost in the compiler's library leaves objects unfinished, whose later use fails. Python 3.11
    raises RuntimeError from an exception in `__set_name__`, which every dataclass calls at its definition.
    """
    try:
        yield
    except Exception:  # of any kind: the unfinished object decides; without an interrupt it goes on unchanged
        if _raised is None:
            raise
        raise _raised from None


class Stop:
    """Context in which the signals of `ENDING` are stored instead of raised.

    Attributes:
        number: the signal that was received, None before.
        detail: what did not end by itself, "" if nothing.
    """

    def __init__(self, running: Callable[[], str] = lambda: "") -> None:
        """Prepare the context.

        Args:
            running: returns the name of the Python block that runs, "" if none does. A block that still runs after
                `BLOCK_LIMIT` is interrupted by `Interrupted`, so that the log is completed.
        """
        # An interrupt that a library has caught while it was imported ends the run.
        self.number = None if _raised is None else _raised.signal
        self.detail, self._running, self._patience = "", running, Patience(BLOCK_LIMIT)

    def __enter__(self) -> "Stop":
        handlers = dict.fromkeys(ENDING, self._note) | {signal.SIGALRM: self._interrupt_block}
        self._before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
        return self

    def _note(self, number: int, _: object) -> None:
        if self.number is None:
            self._patience.restart()
            signal.setitimer(signal.ITIMER_REAL, REPEAT_DELAY, REPEAT_DELAY)
        self.number = number

    def _interrupt_block(self, *_: object) -> None:
        if self.number is not None and self._patience.over and (name := self._running()):
            self.detail = f"block {name} did not return"
            self.check()

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raise `Interrupted` if a signal was received."""
        if self.number is not None:
            raise Interrupted(self.number, self.detail)


def raise_on_interrupt() -> None:
    """Let the signals of `ENDING` raise `Interrupted` immediately; a run uses `Stop` instead."""

    def raise_(number: int, _: object) -> None:
        global _raised
        _raised = _raised or Interrupted(number)
        # An exception that is raised inside a call from the compiler's library is lost there: raise it again, later.
        signal.signal(signal.SIGALRM, lambda *_: raise_(number, None))
        signal.setitimer(signal.ITIMER_REAL, REPEAT_DELAY)
        raise Interrupted(number)

    def report_unraisable(unraisable: "sys.UnraisableHookArgs") -> None:
        # An interrupt leaves objects whose constructor has not finished; their `__del__` may fail.
        if _raised is None:
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
