"""Router process: the endpoint for external clients of a run, such as a viewer or a ROS 2 bridge.

It is not part of the lock step: the services are connected pairwise, and the router only forwards their messages.
"""

import time
from typing import Any

from lapwing.cosim.executors.participant import POLL, Participant, Stopped


def run(process: Participant, spec: Any) -> None:
    """Route until the recorder has the entire run.

    Args:
        process: this process as a participant of the run.
        spec: its `ProcessSpec`.

    Raises:
        Stopped: this process was requested to end.
    """
    process.join()
    process.confirm()  # the router reads no messages
    process.stop_without("recorder")
    while not process.stopping:
        time.sleep(POLL)
    if not process.abandoned:
        raise Stopped
