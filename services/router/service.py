"""The listen endpoint for programs outside a run, a viewer or a ROS 2 bridge: they connect to it as clients.

It is no part of the lock step: the services are joined pairwise, and the router only passes on what they publish.
"""

import time
from typing import Any

from lapwing.cosim.executors.participant import POLL, Participant, Stopped


def run(process: Participant, given: Any) -> None:
    """Route until the recorder has the entire run, or until asked to stop."""
    process.join()
    process.confirm()  # it takes no messages, but passes them on
    process.stop_without("recorder")
    while not process.stopping:
        time.sleep(POLL)
    if not process.abandoned:
        raise Stopped
