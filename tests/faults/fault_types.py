"""Faults of a run, and their expected results."""

import os
import re
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

LAUNCHER = "launcher"
PAUSE = 1.0  # [s] that a flight must wait for
FROZEN = 30.0  # [s] after which a launcher that was frozen is let go on


FULL = "full disk"
TERMINATE = "terminate"
INTERRUPT = "Ctrl-C"  # at any moment; where the seed is odd nothing is compiled yet


class Kind(NamedTuple):
    """A kind of fault."""

    strike: Callable[[int], None]  # at a process
    # what is wrong with an end: (victim, exit code, standard error); "" if nothing
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
    """For a while the process gets a tenth of the time."""
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


def _flies_on(victim: str, code: int, said: str) -> str:
    return "" if (code, said) == (0, "") else f"expected a flight to its end, got exit code {code}: {said}"


def _named(pattern: str) -> Callable[[str, int, str], str]:
    def check(victim: str, code: int, said: str) -> str:
        expected = pattern.replace("VICTIM", victim)
        if code == 1 and re.fullmatch(rf"lapwing: {expected}.*\n", said):
            return ""
        return f"expected exit code 1 and {expected!r}, got {code}: {said!r}"

    return check


def _no_space(victim: str, code: int, said: str) -> str:
    right = code == 2 and said.startswith("lapwing: ") and "no space left" in said.lower() and said.count("\n") == 1
    return "" if right else f"expected exit code 2 and that there is no space left, got {code}: {said!r}"


def _interrupted(victim: str, code: int, said: str) -> str:
    right = (code, said) == (130, "lapwing: ended by SIGINT\n")
    return "" if right else f"expected exit code 130 and one line, got {code}: {said!r}"


def _terminated(victim: str, code: int, said: str) -> str:
    if victim != LAUNCHER:
        return _named(r"VICTIM ended unexpectedly \(signal 15\)")(victim, code, said)
    right = (code, said) == (143, "lapwing: ended by SIGTERM\n")
    return "" if right else f"expected exit code 143 and one line, got {code}: {said!r}"


KINDS = {
    "kill": Kind(kill, _named(r"VICTIM ended unexpectedly \(signal 9\)")),
    "freeze": Kind(freeze, _named("VICTIM: (no answer|stopped) for")),
    "pause": Kind(pause, _flies_on),
    "starve": Kind(starve, _flies_on),
    FULL: Kind(nothing, _no_space),
    INTERRUPT: Kind(interrupt, _interrupted),
    TERMINATE: Kind(terminate, _terminated),
}
