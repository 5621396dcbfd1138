"""Deadlines of a run with a real-time factor: number of late ticks and largest lateness of each service and of the run.

A service is late at a tick when its own step takes longer than a tick; the clock owner is late when it cannot
begin a tick in time because the previous tick is not complete, whichever service caused it.
"""

import json
from collections.abc import Mapping
from typing import NamedTuple

MISSED, WORST = "missed_deadlines", "worst_lateness"  # keys of a log's metadata


class Lateness(NamedTuple):
    """Number of late ticks of a service in a run, and the largest delay."""

    ticks: int  # number of late ticks
    worst: float  # [s], 0 without a late tick


class Deadlines:
    """Counts the ticks at which one service was late."""

    def __init__(self) -> None:
        self._ticks, self._worst = 0, 0.0

    def note(self, late: float) -> None:
        """Count a tick that was finished `late` [s] after its time; negative if it was early."""
        if late > 0.0:
            self._ticks += 1
            self._worst = max(self._worst, late)

    def to_text(self) -> str:
        """Return the counts as text, which `lateness` parses."""
        return json.dumps(Lateness(self._ticks, self._worst))


def lateness(text: str) -> Lateness:
    """Parse the result of `Deadlines.to_text`.

    Raises:
        ValueError: the text is invalid.
    """
    try:
        ticks, worst = json.loads(text)
        return Lateness(int(ticks), float(worst))
    except TypeError as error:
        raise ValueError(f"not a lateness: {error}") from None


def metadata_entries(services: Mapping[str, Lateness]) -> dict[str, str]:
    """Return entries of a log's metadata from the lateness of each service; empty without reports."""
    if not services:
        return {}
    return {
        MISSED: ", ".join(f"{name} {late.ticks}" for name, late in sorted(services.items())),
        WORST: ", ".join(f"{name} {1e3 * late.worst:.2f} ms" for name, late in sorted(services.items())),
    }
