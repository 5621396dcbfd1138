"""Faults of a run, and their expected results."""

import os
import re
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

LAUNCHER = "launcher"
PAUSE = 1.0  # [s] of a stopped process that a flight must survive
FROZEN = 30.0  # [s] until a frozen launcher is resumed


FULL = "full disk"
TERMINATE = "terminate"
INTERRUPT = "Ctrl-C"  # at any time; with an odd seed, the kernel cache is empty


class Kind(NamedTuple):
    """A kind of fault."""

    strike: Callable[[int], None]  # applies the fault to a process id
    # error in the end of a run: (victim, exit code, standard error); "" without error
    ends: Callable[[str, int, str], str]


def kill(pid: int) -> None:
    _send(pid, signal.SIGKILL)


def terminate(pid: int) -> None:
    _send(pid, signal.SIGTERM)


def freeze(pid: int) -> None:
    _send(pid, signal.SIGSTOP)


def pause(pid: int) -> None:
    _send(pid, signal.SIGSTOP)
    time.sleep(PAUSE)
    _send(pid, signal.SIGCONT)


def starve(pid: int) -> None:
    """Limit a process to a tenth of the processor time for 2 s."""
    for _ in range(20):
        _send(pid, signal.SIGSTOP)
        time.sleep(0.09 * PAUSE)
        _send(pid, signal.SIGCONT)
        time.sleep(0.01 * PAUSE)


def interrupt(pid: int) -> None:
    _send(pid, signal.SIGINT)


def nothing(pid: int) -> None:
    """Do nothing to a process; trial.py applies the fault."""


def _send(pid: int, number: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)


def _flies_on(victim: str, code: int, text: str) -> str:
    return "" if (code, text) == (0, "") else f"expected a flight to its end, got exit code {code}: {text}"


def _named(pattern: str) -> Callable[[str, int, str], str]:
    def check(victim: str, code: int, text: str) -> str:
        expected = pattern.replace("VICTIM", victim)
        if code == 1 and re.fullmatch(rf"lapwing: {expected}.*\n", text):
            return ""
        return f"expected exit code 1 and {expected!r}, got {code}: {text!r}"

    return check


def _no_space(victim: str, code: int, text: str) -> str:
    right = code == 2 and text.startswith("lapwing: ") and "no space left" in text.lower() and text.count("\n") == 1
    return "" if right else f"expected exit code 2 and that there is no space left, got {code}: {text!r}"


def _interrupted(victim: str, code: int, text: str) -> str:
    right = (code, text) == (130, "lapwing: ended by SIGINT\n")
    return "" if right else f"expected exit code 130 and one line, got {code}: {text!r}"


def _terminated(victim: str, code: int, text: str) -> str:
    if victim != LAUNCHER:
        return _named(r"VICTIM ended unexpectedly \(signal 15\)")(victim, code, text)
    right = (code, text) == (143, "lapwing: ended by SIGTERM\n")
    return "" if right else f"expected exit code 143 and one line, got {code}: {text!r}"


KINDS = {
    "kill": Kind(kill, _named(r"VICTIM ended unexpectedly \(signal 9\)")),
    "freeze": Kind(freeze, _named("VICTIM: (no answer|stopped) for")),
    "pause": Kind(pause, _flies_on),
    "starve": Kind(starve, _flies_on),
    FULL: Kind(nothing, _no_space),
    INTERRUPT: Kind(interrupt, _interrupted),
    TERMINATE: Kind(terminate, _terminated),
}
