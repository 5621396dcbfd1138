"""Status texts and events of a firmware: its last error, failsafe, and reasons against arming."""

import re
from dataclasses import dataclass, field

from lapwing.services.common.mavlink.dialect import mavlink

BLOCKERS = 5  # last status texts kept while arming is rejected
ACTIVATED = "Failsafe activated"  # status text sent with an event that has cause and action
FAILSAFE = re.compile("failsafe|crash|emergency|parachute|termination", re.IGNORECASE)  # in status texts


@dataclass
class StatusTexts:
    """Last error, last failsafe and reasons against arming of a firmware."""

    error: str = ""  # last status text of the level error or worse
    failsafe: str = ""  # last event or status text about a failsafe since arming
    blockers: list[str] = field(default_factory=list)  # status texts since arming was rejected
    has_event: bool = False  # an event has named a failsafe

    def arm(self) -> None:
        """Clear the failsafe and the reasons from before arming."""
        self.failsafe, self.blockers = "", []

    def add_event(self, text: str) -> None:
        """Store the text of a failsafe's event; "" of a warning, with which PX4 also sends the status text."""
        self.failsafe = text or ("" if self.failsafe.startswith(ACTIVATED) else self.failsafe)
        self.has_event = True

    def add(self, text: str, severity: int, armed: bool, is_arming: bool) -> None:
        """Store a status text of a MAV_SEVERITY."""
        if severity <= mavlink.MAV_SEVERITY_ERROR:
            self.error = text
        if armed and FAILSAFE.search(text) and not (self.has_event and text.startswith(ACTIVATED)):
            self.failsafe = text
        if is_arming and severity <= mavlink.MAV_SEVERITY_WARNING:
            self.blockers = [*[old for old in self.blockers if old != text], text][-BLOCKERS:]
