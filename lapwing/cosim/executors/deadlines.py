"""Deadlines of a run that keeps a speed: how often a service, and the run as a whole, is late, and by how much at most.

A service is late at a tick when its own step takes longer than a tick may; the clock owner is late when it cannot
begin a tick in time because the previous tick is not complete, whichever service caused it.
"""

import json
from collections.abc import Mapping
from typing import NamedTuple

MISSED, WORST = "missed_deadlines", "worst_lateness"  # keys of a log's metadata


class Lateness(NamedTuple):
    """Number of late ticks of a service in a run, and the largest delay."""

    ticks: int  # at which it was late
    worst: float  # [s], 0 where it never was


class Deadlines:
    """Counts the ticks at which one service was late."""

    def __init__(self) -> None:
        self._ticks, self._worst = 0, 0.0

    def note(self, late: float) -> None:
        """Count a tick that was done `late` seconds after its time; negative where it was early."""
        if late > 0.0:
            self._ticks += 1
            self._worst = max(self._worst, late)

    def to_text(self) -> str:
        """Return the counts as text, which `lateness` parses."""
        return json.dumps(Lateness(self._ticks, self._worst))


def lateness(told: str) -> Lateness:
    """Parse the result of `Deadlines.to_text`.

    Raises:
        ValueError: something else.
    """
    try:
        ticks, worst = json.loads(told)
        return Lateness(int(ticks), float(worst))
    except TypeError as error:
        raise ValueError(f"no lateness: {error}") from None


def entries(found: Mapping[str, Lateness]) -> dict[str, str]:
    """Return entries of a log's metadata from the lateness of each service, empty without reports."""
    if not found:
        return {}
    return {
        MISSED: ", ".join(f"{name} {late.ticks}" for name, late in sorted(found.items())),
        WORST: ", ".join(f"{name} {1e3 * late.worst:.2f} ms" for name, late in sorted(found.items())),
    }
