"""The kinds of events of a flight, in the order in which events of the same time are told."""

from typing import NamedTuple


class Kind(NamedTuple):
    """What events of a kind have in common."""

    serious: bool = False  # viewers are to show them as warnings
    afterwards: bool = False  # what is told of them is known only when they are over


KINDS = {
    "fault": Kind(serious=True),
    "warning": Kind(serious=True),
    "failsafe": Kind(serious=True),
    "mode": Kind(),
    "phase": Kind(),
    "arming": Kind(),
    "contact": Kind(),
    "slack": Kind(serious=True),
    "motors": Kind(afterwards=True),
    "battery": Kind(),
}
"""By name: faults, doubts about the models, failsafes, modes and phases, arming, contact with
the ground, slack links, motors at a limit, charge."""
