"""Kinds of flight events, in the order in which simultaneous events are listed."""

from typing import NamedTuple


class Kind(NamedTuple):
    """Properties of an event kind."""

    serious: bool = False  # viewers show it as a warning
    afterwards: bool = False  # its text is complete only at its end


KINDS = {
    "fault": Kind(serious=True),
    "warning": Kind(serious=True),
    "failsafe": Kind(serious=True),
    "mode": Kind(),
    "phase": Kind(),
    "arming": Kind(),
    "refused": Kind(),
    "contact": Kind(),
    "crash": Kind(serious=True, afterwards=True),
    "slack": Kind(serious=True),
    "motors": Kind(afterwards=True),
    "battery": Kind(),
}
"""Event kinds by name: faults, validity warnings, failsafes, modes and phases, arming, refused commands,
contact, the crash, slack links, motors at a limit, charge."""
